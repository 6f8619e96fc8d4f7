//! Each debug view shows what it says, finite and unlike the finished clouds.

use bevy::{
    math::Vec4Swizzles,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{CachedPipeline, CachedPipelineState, PipelineCache, PipelineDescriptor},
    },
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{Sky, View, cloud_pixels, new_clouds_app, spawn_sun, spawn_view, until_baked, until_drawn},
    gpu::run_updates,
    scene::{CLEAR, exact, greatest_difference, linear_pixels, settle, slab_app, spawn_linear},
    uniform_slab::UniformSlab,
};

fn show(app: &mut App, view: &View, debug: CloudDebugView) {
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = debug;
    until_drawn(app);
    run_updates(app, 12);
}

/// How many march pipelines there are.
fn marches(app: &App) -> usize {
    let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
    let label = |p: &CachedPipeline| {
        assert!(!matches!(p.state, CachedPipelineState::Err(_)), "{:?}", p.state);
        match &p.descriptor {
            PipelineDescriptor::ComputePipelineDescriptor(d) => d.label.clone(),
            _ => None,
        }
    };
    cache.pipelines().filter_map(label).filter(|label| label == "cloud_march").count()
}

#[test]
fn every_view_is_finite_and_its_own_and_none_is_as_before() {
    for sky in [Sky::Black, Sky::Atmosphere] {
        // New: how many shaders it makes is counted.
        let mut app = new_clouds_app();
        until_baked(&mut app);
        spawn_sun(&mut app, Vec3::new(0.3, -0.6, 1.0));
        let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.5, -1.0), Vec3::Y);
        let view = spawn_view(&mut app, UVec2::new(32, 18), looking, sky);
        until_drawn(&mut app);
        run_updates(&mut app, 12);
        let normal = cloud_pixels(&app, &view);
        assert_eq!(marches(&app), 1, "a shader that nobody asked for");
        let mut seen = vec![(CloudDebugView::None, normal.clone())];
        for debug in CloudDebugView::ALL.into_iter().skip(1) {
            show(&mut app, &view, debug);
            let pixels = cloud_pixels(&app, &view);
            let fine = |p: &Vec4| p.is_finite() && p.min_element() >= 0.0 && p.w <= 1.0;
            assert!(pixels.iter().all(fine), "{debug:?}, {sky:?}");
            assert!(pixels.iter().any(|p| p.xyz().max_element() > 0.0), "{debug:?}, {sky:?} is black");
            for (other, before) in &seen {
                assert!(pixels != *before, "{debug:?} looks as {other:?} does, {sky:?}");
            }
            seen.push((debug, pixels));
        }
        assert_eq!(marches(&app), 4, "one march for clouds, one for stages, one for maps, one that counts");
        show(&mut app, &view, CloudDebugView::None);
        // Sixteen bits a frame and another phase of the window: nearly the same.
        let after = cloud_pixels(&app, &view);
        let worst = after.iter().zip(&normal).map(|(a, b)| (a.w - b.w).abs()).fold(0.0, f32::max);
        assert!(worst < 2e-3, "transmittance differs by {worst}, {sky:?}");
    }
}

#[test]
fn views_of_single_parts_take_light_away() {
    let mut app = slab_app(1000.0, 3000.0, 0.002);
    let up = Transform::from_xyz(0.0, 0.0, 0.0).looking_to(Vec3::new(0.0, 1.0, -0.5), Vec3::Z);
    let view = spawn_linear(&mut app, UVec2::new(8, 8), up);
    until_drawn(&mut app);
    let mut sum = |debug| {
        show(&mut app, &view, debug);
        cloud_pixels(&app, &view).iter().map(|p| p.y).sum::<f32>()
    };
    let all = sum(CloudDebugView::None);
    let multiple = sum(CloudDebugView::MultipleScattering);
    let single = sum(CloudDebugView::SingleScattering);
    assert!(0.0 < single && single < 0.9 * multiple && multiple < 0.99 * all, "{single}, {multiple}, {all}");
}

/// A model without `debug_value`, so this also says that it is not needed.
#[test]
fn values_of_a_slab_are_its_own() {
    let (extinction, thickness) = (0.001, 2000.0);
    let mut app = slab_app(1000.0, 1000.0 + thickness, extinction);
    app.insert_resource(CloudQuality { step: 50.0, step_growth: 0.0, ..exact(MarchResolution::Full) });
    let up = Transform::from_xyz(0.0, 0.0, 0.0).looking_to(Vec3::Y, Vec3::Z);
    let view = spawn_linear(&mut app, UVec2::new(9, 9), up);
    until_drawn(&mut app);
    let mut middle = |debug| {
        show(&mut app, &view, debug);
        linear_pixels(&app, &view)[40]
    };
    let through = (-extinction * thickness).exp();
    let transmittance = middle(CloudDebugView::Transmittance);
    assert!((transmittance - Vec3::splat(through)).abs().max_element() < 0.01, "{transmittance}, {through} is right");
    // Half a grey volume's profile (0.5), and white for the density, before what shines through.
    for (debug, grey) in [(CloudDebugView::DimensionalProfile, 0.5), (CloudDebugView::ErodedDensity, 1.0)] {
        let (shown, right) = (middle(debug), CLEAR * through + grey * (1.0 - through));
        assert!((shown - right).abs().max_element() < 0.01, "{debug:?}: {shown}, {right} is right");
    }
    // ∫ t e^(−σt) dt / ∫ e^(−σt) dt over the slab.
    let mean = 1000.0 + 1.0 / extinction - thickness * through / (1.0 - through);
    let depth = middle(CloudDebugView::CloudDepth) * CloudQuality::default().max_distance;
    assert!((depth - Vec3::splat(mean)).abs().max_element() < 40.0, "{depth} m, {mean} m is right");
    // 40 small steps, after a long one that found cloud; red is half up the logarithm of the most, yellow three quarters.
    let share = f32::log2(42.0) / f32::log2(1.0 + CloudQuality::default().max_steps as f32);
    let steps = middle(CloudDebugView::Steps);
    let t = 4.0 * share;
    let right = Vec3::new(t - 1.0, t - 2.0, (1.0 - (t - 1.0).abs()).max(t - 3.0)).clamp(Vec3::ZERO, Vec3::ONE);
    assert!((steps - right).abs().max_element() < 0.03, "{steps}, {right} is right");
}

#[test]
fn a_change_of_the_view_drops_the_history() {
    let mut app = slab_app(1000.0, 3000.0, 0.001);
    app.insert_resource(CloudQuality {
        window: 16,
        temporal: TemporalMode::SlidingWindow,
        ..exact(MarchResolution::Full)
    });
    let up = Transform::from_xyz(0.0, 0.0, 0.0).looking_to(Vec3::Y, Vec3::Z);
    let view = spawn_linear(&mut app, UVec2::new(8, 8), up);
    until_drawn(&mut app);
    let still = |app: &mut App, debug| {
        app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = debug;
        settle(app);
        linear_pixels(app, &view)
    };
    // With the window full of clouds, three frames after the change nothing of them is left.
    show(&mut app, &view, CloudDebugView::NoPhase);
    run_updates(&mut app, 20);
    let early = still(&mut app, CloudDebugView::MultipleScattering);
    run_updates(&mut app, 20);
    let late = linear_pixels(&app, &view);
    assert!(greatest_difference(&early, &late) < 0.01, "{}", greatest_difference(&early, &late));
}

#[test]
fn a_users_model_without_maps_keeps_its_clouds() {
    let slab = UniformSlab::new(1000.0, 3000.0, 0.002);
    // One of its shaders fails, which must not be found in others' apps.
    let mut app = slab.alone();
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let up = Transform::from_xyz(0.0, 0.0, 0.0).looking_to(Vec3::Y, Vec3::Z);
    let view = spawn_linear(&mut app, UVec2::new(8, 8), up);
    until_drawn(&mut app);
    settle(&mut app);
    let normal = linear_pixels(&app, &view);
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = CloudDebugView::TypeMap;
    run_updates(&mut app, 4);
    // The log names the missing function; the clouds stay, with the air that all debug views leave out.
    let without_map = linear_pixels(&app, &view);
    assert!(greatest_difference(&normal, &without_map) < 0.01);
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = CloudDebugView::None;
    run_updates(&mut app, 4);
    assert!(app.world().resource::<CloudStatus>().is_ready());
    let again = linear_pixels(&app, &view);
    assert!(greatest_difference(&normal, &again) < 1e-3);
    assert!(again.iter().any(|p| (*p - CLEAR).abs().max_element() > 0.01), "there are no clouds at all");
}

#[test]
fn names_are_unique_and_lead_back() {
    for view in CloudDebugView::ALL {
        assert_eq!(CloudDebugView::named(&view.name()), Some(view));
    }
    assert_eq!(CloudDebugView::named("coverage_map"), Some(CloudDebugView::CoverageMap));
    assert_eq!(CloudDebugView::named("xray"), None);
}
