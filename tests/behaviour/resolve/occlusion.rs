//! Scene and cloud hide each other as their distances say, at every resolution, with and without MSAA.

use bevy::{
    asset::RenderAssetUsages,
    camera::Exposure,
    light::{Atmosphere, Skybox, atmosphere::ScatteringMedium},
    pbr::AtmosphereSettings,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension},
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{View, cloud_pixels, until_drawn},
    gpu::needs_atmosphere,
    scene::{
        CLEAR, enable, exact, greatest_difference, linear_pixels, settle, slab_app, spawn_box, spawn_linear,
        without_clouds,
    },
};

const SIZE: UVec2 = UVec2::new(48, 32);
/// Tangent of half the default field of view, 45°.
const HALF: f32 = 0.414_213_56;
const GREY: Vec3 = Vec3::new(0.6, 0.5, 0.4);
const RESOLUTIONS: [MarchResolution; 3] = [MarchResolution::Full, MarchResolution::Half, MarchResolution::Quarter];

/// Every marched resolution with and without MSAA.
fn for_each_way(app: &mut App, view: &View, mut check: impl FnMut(&mut App, MarchResolution, Msaa)) {
    for msaa in [Msaa::Off, Msaa::Sample4] {
        for resolution in RESOLUTIONS {
            app.insert_resource(exact(resolution));
            app.world_mut().entity_mut(view.camera).insert(msaa);
            settle(app);
            check(app, resolution, msaa);
        }
    }
}

fn show(app: &mut App, things: &[Entity], visible: bool) {
    for thing in things {
        let visibility = if visible { Visibility::Visible } else { Visibility::Hidden };
        app.world_mut().entity_mut(*thing).insert(visibility);
    }
    settle(app);
}

#[test]
fn what_is_nearer_hides_the_cloud_without_a_halo() {
    // A slab 1.5 km up behind a wall over the left of the view, and a pole of little more than two pixels on the right.
    let mut app = slab_app(1500.0, 2500.0, 0.001);
    let camera = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()));
    let view = spawn_linear(&mut app, SIZE, camera);
    let pixel = 2.0 * HALF / SIZE.y as f32;
    // The wall's edge is within a texel of every coarse resolution: 19 of 48 pixels.
    let edge = (19.0 - 24.0) * pixel * 200.0;
    let wall = camera * Transform::from_xyz(edge - 100.0, 0.0, -200.0);
    let wall = spawn_box(&mut app, Vec3::new(200.0, 400.0, 0.1), wall, GREY);
    let pole = camera * Transform::from_xyz(9.3 * pixel * 100.0, 0.0, -100.0);
    let pole = spawn_box(&mut app, Vec3::new(2.2 * pixel * 100.0, 400.0, 0.1), pole, GREY);
    until_drawn(&mut app);
    for_each_way(&mut app, &view, |app, resolution, msaa| {
        let what = format!("{resolution:?}, {msaa:?}");
        show(app, &[wall, pole], false);
        let open = linear_pixels(app, &view);
        show(app, &[wall, pole], true);
        let shown = linear_pixels(app, &view);
        let bare = without_clouds(app, &view);
        let (mut covered, mut pole_rows, mut beside) = (0, 0, 0);
        for (k, ((shown, bare), open)) in shown.iter().zip(&bare).zip(&open).enumerate() {
            let at = UVec2::new(k as u32 % SIZE.x, k as u32 / SIZE.x);
            assert!((*open - CLEAR).abs().max_element() > 0.05, "{what}: no cloud at {at}");
            // Pixels partly covered under MSAA mix both; those are neither.
            if bare.abs_diff_eq(GREY, 1e-3) {
                covered += 1;
                pole_rows += u32::from(at.x > 24);
                assert!(shown.abs_diff_eq(GREY, 2e-3), "{what}: cloud before the wall at {at}: {shown}");
            } else if bare.abs_diff_eq(CLEAR, 1e-3) {
                // Where neighbouring texels are refused, the rest stand in for them: a gradient's worth of error.
                let off = (*shown - *open).abs().max_element() / open.max_element();
                beside += 1;
                assert!(off < 0.03, "{what}: a halo at {at}: {shown} instead of {open}");
            }
        }
        assert!(covered > 500 && beside > 600, "{what}: {covered} pixels of wall, {beside} of sky");
        assert!(pole_rows >= SIZE.y, "{what}: the pole covers {pole_rows} pixels");
    });
}

#[test]
fn what_is_farther_shows_through_in_proportion() {
    // Inside a fog from below to above the view; T = e^(−σd) holds exactly (Beer–Lambert, thesis equation 2.2).
    const EXTINCTION: f32 = 0.002;
    let mut app = slab_app(-300.0, 3000.0, EXTINCTION);
    let camera = Transform::from_xyz(0.0, 1000.0, 0.0);
    let view = spawn_linear(&mut app, SIZE, camera);
    let exposure = app.world().get::<Exposure>(view.camera).unwrap().exposure();
    let wall = spawn_box(&mut app, Vec3::new(4000.0, 4000.0, 1.0), camera, GREY);
    until_drawn(&mut app);
    for_each_way(&mut app, &view, |app, resolution, msaa| {
        let mut last = 0.0;
        for distance in [1500.0, 700.0, 200.0, 40.0] {
            let what = format!("{resolution:?}, {msaa:?}, {distance} m");
            app.world_mut().entity_mut(wall).insert(Transform::from_xyz(0.0, 1000.0, -distance - 0.5));
            settle(app);
            let (clouds, shown) = (cloud_pixels(app, &view), linear_pixels(app, &view));
            for (k, (cloud, shown)) in clouds.iter().zip(&shown).enumerate() {
                let at = Vec2::new((k as u32 % SIZE.x) as f32, (k as u32 / SIZE.x) as f32) + 0.5;
                let across = (at - 0.5 * SIZE.as_vec2()) * (2.0 * HALF / SIZE.y as f32);
                let slant = distance * across.extend(1.0).length();
                let expected = (-EXTINCTION * slant).exp();
                // A coarse texel is marched once, to the farthest of its pixels.
                let step = resolution.divisor() as f32 - 1.0;
                let tolerance = 2e-3 + 0.006 * step;
                assert!((cloud.w - expected).abs() < tolerance, "{what} at {at}: {} for {expected}", cloud.w);
                let blended = GREY * cloud.w + cloud.truncate() * exposure;
                assert!(shown.abs_diff_eq(blended, 4e-3), "{what} at {at}: {shown} for {blended}");
            }
            let mean = clouds.iter().map(|c| c.w).sum::<f32>() / clouds.len() as f32;
            assert!(mean > last + 0.01, "{what}: transmittance {mean} does not rise as the wall comes nearer");
            last = mean;
        }
        assert!(last > 0.9, "{resolution:?}, {msaa:?}: {last} before a wall at 40 m");
    });
}

#[test]
fn clouds_blend_over_any_backdrop() {
    needs_atmosphere();
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let camera = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()));
    let view = spawn_linear(&mut app, SIZE, camera);
    let exposure = app.world().get::<Exposure>(view.camera).unwrap().exposure();
    until_drawn(&mut app);
    for backdrop in ["clear", "skybox", "atmosphere"] {
        match backdrop {
            "skybox" => spawn_skybox(&mut app, &view),
            "atmosphere" => spawn_atmosphere(&mut app, &view),
            _ => {}
        }
        for (msaa, resolution) in [(Msaa::Off, MarchResolution::Full), (Msaa::Sample4, MarchResolution::Half)] {
            let what = format!("{backdrop}, {resolution:?}, {msaa:?}");
            app.insert_resource(exact(resolution));
            // Bevy's atmosphere and MSAA are tested apart; here both are only drawn over.
            app.world_mut().entity_mut(view.camera).insert(msaa);
            let bare = without_clouds(&mut app, &view);
            if backdrop != "clear" {
                let plain = bare.iter().all(|b| b.abs_diff_eq(CLEAR, 1e-3));
                assert!(!plain, "{what}: the backdrop is not there");
            }
            let (clouds, shown) = (cloud_pixels(&app, &view), linear_pixels(&app, &view));
            let blended: Vec<Vec3> =
                bare.iter().zip(&clouds).map(|(b, c)| *b * c.w + c.truncate() * exposure).collect();
            assert!(clouds.iter().all(|c| c.w < 0.9 && c.x > 0.0), "{what}: no cloud");
            // The view's colour is in half floats: 11 bits each for what is behind and for the sum.
            let brightest = blended.iter().map(|b| b.max_element()).fold(0.0, f32::max);
            let off = greatest_difference(&shown, &blended);
            assert!(off < 3e-3 * brightest.max(1.0), "{what}: off by {off} of {brightest}");
        }
        app.world_mut().entity_mut(view.camera).remove::<Skybox>();
        enable(&mut app, &view, true);
    }
}

/// A cubemap whose faces have six colours.
fn spawn_skybox(app: &mut App, view: &View) {
    let faces: Vec<u8> = (0..6_u8).flat_map(|f| [40 * f + 20, 250 - 40 * f, 128, 255].repeat(16)).collect();
    let size = Extent3d { width: 4, height: 4, depth_or_array_layers: 6 };
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new(size, TextureDimension::D2, faces, format, RenderAssetUsages::RENDER_WORLD);
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    let skybox = Skybox { image: Some(image), brightness: 5000.0, ..default() };
    app.world_mut().entity_mut(view.camera).insert(skybox);
}

fn spawn_atmosphere(app: &mut App, view: &View) {
    let world = app.world_mut();
    let medium = world.resource_mut::<Assets<ScatteringMedium>>().add(ScatteringMedium::earth(256, 256));
    world.spawn(Atmosphere::earth(medium));
    world.entity_mut(view.camera).insert(AtmosphereSettings::default());
}
