//! Bad input is reported by name; the last good value stays, and nothing panics.

mod cameras;
mod device;

use bevy::{
    ecs::component::Mutable,
    prelude::*,
    render::{RenderPlugin, settings::WgpuSettings},
};
use bevy_cumulus::{prelude::*, settings::SettingsError, settings::Validate};

use crate::support::{
    app::{View, cloud_pixels, clouds_app, spawn_sun, until_drawn},
    gpu::{headless_plugins, run_updates, times_logged},
    scene::{CLEAR, exact, linear_pixels, settle, slab_app, spawn_linear},
    shared::SharedApp,
};

const SIZE: UVec2 = UVec2::new(24, 16);

fn looking_up() -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()))
}

fn above_one_camera() -> (SharedApp, View) {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let view = spawn_linear(&mut app, SIZE, looking_up());
    until_drawn(&mut app);
    settle(&mut app);
    (app, view)
}

fn is_bare(app: &App, view: &View) -> bool {
    linear_pixels(app, view).iter().all(|p| p.abs_diff_eq(CLEAR, 1e-3))
}

/// One bad change: what the error says, and the change.
pub type Bad<S> = (&'static str, fn(&mut S));

/// Makes each change, and asks that it be reported and the picture stay as it is.
pub fn refuses<S>(app: &mut App, view: &View, changes: &[Bad<S>])
where
    S: Resource<Mutability = Mutable> + Validate + Clone,
{
    let good = app.world().resource::<S>().clone();
    let picture = cloud_pixels(app, view);
    for (says, change) in changes {
        let logged = times_logged(says);
        change(&mut app.world_mut().resource_mut::<S>());
        let error = app.world().resource::<S>().validate().expect_err(says).to_string();
        assert!(error.contains(says), "{error:?} does not say {says:?}");
        run_updates(app, 3);
        assert_eq!(times_logged(says), logged + 1, "{says:?} is not reported once");
        assert!(cloud_pixels(app, view) == picture, "{says:?} changes the picture");
        app.insert_resource(good.clone());
        run_updates(app, 1);
    }
    assert!(cloud_pixels(app, view) == picture, "the good value does not come back");
}

#[test]
fn bad_settings_are_reported_and_change_nothing() {
    // The built-in model: a slab would not see half of these.
    let mut app = clouds_app();
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    let view = spawn_linear(&mut app, SIZE, looking_up());
    until_drawn(&mut app);
    settle(&mut app);
    refuses::<CloudModel>(
        &mut app,
        &view,
        &[
            ("model.coverage = 7.5 is outside its range -1 to 1", |m| m.coverage = 7.5),
            ("model.density = -0.5 is outside its range 0 to 10", |m| m.density = -0.5),
            ("model.extinction = NaN is outside its range 0 to 1", |m| m.extinction = f32::NAN),
            ("model.map_scale = inf is outside", |m| m.map_scale = f32::INFINITY),
            ("model.albedo.y = -1 is outside", |m| m.albedo.y = -1.0),
            ("model.wind.x = NaN is outside", |m| m.wind.x = f32::NAN),
            ("model.world_offset.z = 1000000000000000000000000000000 is outside", |m| m.world_offset.z = 1e30),
            ("model.top = 1000 must be above model.bottom = 2000", |m| (m.bottom, m.top) = (2000.0, 1000.0)),
            ("model.top = 1234 must be above model.bottom = 1234", |m| (m.bottom, m.top) = (1234.0, 1234.0)),
        ],
    );
    refuses::<CloudLighting>(
        &mut app,
        &view,
        &[
            ("lighting.octaves = 4000000000 is outside its range 0 to 16", |l| l.octaves = 4_000_000_000),
            ("lighting.g = 1 is outside its range -0.99 to 0.99", |l| l.g = 1.0),
            ("lighting.phase_limit = NaN is outside", |l| l.phase_limit = f32::NAN),
            ("lighting.sun_strength = -2 is outside", |l| l.sun_strength = -2.0),
            ("lighting.droplet_diameter = 0 is outside its range 5 to 50", |l| l.droplet_diameter = 0.0),
        ],
    );
    refuses::<CloudQuality>(
        &mut app,
        &view,
        &[
            ("quality.step = 0 is outside its range 0.5 to 5000", |q| q.step = 0.0),
            ("quality.step = NaN is outside", |q| q.step = f32::NAN),
            ("quality.window = 0 is outside its range 1 to 16", |q| q.window = 0),
            ("quality.max_steps = 4294967295 is outside", |q| q.max_steps = u32::MAX),
            ("quality.max_distance = -5 is outside", |q| q.max_distance = -5.0),
            ("quality.long_step = 0 is outside its range 1 to 16", |q| q.long_step = 0),
        ],
    );
    refuses::<CloudTextures>(
        &mut app,
        &view,
        &[
            ("textures.volume_size = 48 must be a power of two from 32 to 256", |t| t.volume_size = 48),
            ("textures.map_size = 1000000000 is outside", |t| t.map_size = 1_000_000_000),
            ("textures.billow_cells = 0 is outside its range 1 to 32", |t| t.billow_cells = 0),
        ],
    );
    refuses::<CloudClock>(
        &mut app,
        &view,
        &[
            ("clock.seconds = NaN is outside", |c| c.seconds = f64::NAN),
            ("clock.speed = -20000 is outside its range -10000 to 10000", |c| c.speed = -20000.0),
        ],
    );
    // Good values are taken, or all of the above would prove nothing.
    let picture = cloud_pixels(&app, &view);
    app.world_mut().resource_mut::<CloudModel>().coverage = 0.3;
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) != picture, "a good value changes nothing either");
}

#[test]
fn a_bad_clock_stands_still() {
    let (mut app, _) = above_one_camera();
    app.insert_resource(CloudClock { seconds: 5.0, speed: 34_567.0 });
    run_updates(&mut app, 3);
    assert_eq!(app.world().resource::<CloudClock>().seconds, 5.0);
    assert_eq!(times_logged("clock.speed = 34567 is outside"), 1, "not reported once");
    app.world_mut().resource_mut::<CloudClock>().speed = 100.0;
    run_updates(&mut app, 2);
    // The first update of the two takes 16 ms as well.
    assert_eq!(app.world().resource::<CloudClock>().seconds, 5.0 + 2.0 * 0.016 * 100.0);
}

#[test]
fn a_views_bad_quality_falls_back_to_the_resource() {
    let (mut app, view) = above_one_camera();
    let picture = cloud_pixels(&app, &view);
    let own = |step| CloudView { quality: Some(CloudQuality { step, ..exact(MarchResolution::Quarter) }), ..default() };
    app.world_mut().entity_mut(view.camera).insert(own(-17.0));
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) == picture);
    assert_eq!(times_logged("view.quality.step = -17"), 1, "the bad step is not reported once");
    app.world_mut().entity_mut(view.camera).insert(own(500.0));
    settle(&mut app);
    assert!(cloud_pixels(&app, &view) != picture, "a good quality of its own changes nothing");
}

#[test]
fn errors_name_field_value_and_range() {
    let error = CloudModel { coverage: 2.0, ..default() }.validate().unwrap_err();
    let SettingsError::OutOfRange { field, value, min, max } = &error else { panic!("{error:?}") };
    assert_eq!([field, value, min, max], ["model.coverage", "2", "-1", "1"]);
}

#[test]
fn without_a_renderer_nothing_happens() {
    // As on a server: with the asset server and nothing else, and with all of Bevy but a GPU.
    let mut bare = App::new();
    bare.add_plugins((MinimalPlugins, bevy::asset::AssetPlugin::default()));
    let mut server = App::new();
    let no_gpu = RenderPlugin { render_creation: WgpuSettings { backends: None, ..default() }.into(), ..default() };
    server.add_plugins(headless_plugins().set(no_gpu));
    for mut app in [bare, server] {
        app.add_plugins(CloudsPlugin);
        app.finish();
        app.cleanup();
        app.world_mut().spawn((Transform::default(), CloudView::default()));
        for _ in 0..3 {
            app.update();
        }
        let status = app.world().resource::<CloudStatus>();
        assert!(status.unsupported().is_some_and(|why| why.contains("no renderer")) && !status.is_ready());
    }
}
