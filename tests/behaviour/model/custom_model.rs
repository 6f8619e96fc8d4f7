//! A model of one's own: taken, refused with its line, and taken again.

use bevy::prelude::*;
use bevy_cumulus::{CloudsPlugin, ModelShader, ModelShaderError, prelude::*};
use rand::{SeedableRng, rngs::StdRng};

use crate::support::{
    app::{new_clouds_app, new_clouds_app_with, spawn_sun, until_baked, until_drawn},
    density::{Question, ask, question},
    gpu::{assert_shaders_compile, run_updates, times_logged},
    scene::{exact, linear_pixels, settle, spawn_linear},
    uniform_slab::slab_text,
};

#[derive(Resource, Default)]
struct Heard(Vec<ModelShaderError>);

fn hear(mut errors: MessageReader<ModelShaderError>, mut heard: ResMut<Heard>) {
    heard.0.extend(errors.read().cloned());
}

/// An app with this model, in place before the built-in one is registered.
fn app_of(model: &str) -> App {
    let model = ModelShader(model.to_owned());
    let insert = move |app: &mut App| {
        app.insert_resource(model.clone());
    };
    let mut app = new_clouds_app_with((insert, CloudsPlugin));
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    app
}

#[test]
fn a_model_that_does_not_compile_leaves_the_last_good_one() {
    let good = slab_text(1500.0, 2500.0, 0.0006).0;
    let mut app = app_of(&good);
    app.init_resource::<Heard>().add_systems(Update, hear);
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()));
    let view = spawn_linear(&mut app, UVec2::new(12, 8), up);
    until_drawn(&mut app);
    settle(&mut app);
    let picture = linear_pixels(&app, &view);
    // A type, a name, and a sign that is missing: on lines of their own.
    for (spoilt, line) in [
        (good.replace("return 1.0;", "\n\nreturn 1u;"), 5),
        (good.replace("return empty_medium();", "\nreturn nothing_7391();"), 7),
        (good.replace("return vec2(", "\nreturn vec2(("), 3),
    ] {
        assert_ne!(spoilt, good);
        let says = format!("the model does not compile, line {line}: ");
        let (logged, heard) = (times_logged(&says), app.world().resource::<Heard>().0.len());
        app.insert_resource(ModelShader(spoilt.clone()));
        run_updates(&mut app, 6);
        assert!(linear_pixels(&app, &view) == picture, "the clouds change: {spoilt}");
        assert!(app.world().resource::<CloudStatus>().is_ready());
        assert_shaders_compile(&app);
        assert_eq!(
            times_logged(&says),
            logged + 1,
            "{says:?} is not reported once: {:?}",
            app.world().resource::<Heard>().0
        );
        let told = &app.world().resource::<Heard>().0[heard..];
        assert!(told.len() == 1 && told[0].line == Some(line), "{told:?}");
    }
    // A good one is taken again, and the first of them, too.
    app.insert_resource(slab_text(1500.0, 2500.0, 0.003));
    settle(&mut app);
    until_drawn(&mut app);
    settle(&mut app);
    assert!(linear_pixels(&app, &view) != picture, "a good model is not taken after a bad one");
    app.insert_resource(ModelShader(good));
    settle(&mut app);
    until_drawn(&mut app);
    settle(&mut app);
    assert!(linear_pixels(&app, &view) == picture);
}

#[test]
fn the_built_in_model_is_back_when_the_resource_is_removed() {
    let mut app = app_of(&slab_text(1500.0, 2500.0, 0.0006).0);
    app.world_mut().remove_resource::<ModelShader>();
    app.insert_resource(CloudModel { coverage: 0.7, ..default() });
    let up = Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()));
    let view = spawn_linear(&mut app, UVec2::new(12, 8), up);
    let picture = |app: &mut App| {
        settle(app);
        until_drawn(app);
        settle(app);
        linear_pixels(app, &view)
    };
    // Removed before it was ever seen.
    let built_in = picture(&mut app);
    app.insert_resource(slab_text(1500.0, 2500.0, 0.0006));
    assert!(picture(&mut app) != built_in, "the model is not replaced");
    app.world_mut().remove_resource::<ModelShader>();
    assert!(picture(&mut app) == built_in, "the built-in model is not back");
    app.insert_resource(slab_text(1500.0, 2500.0, 0.003));
    assert!(picture(&mut app) != built_in, "the model is not replaced again");
}

#[test]
fn the_examples_rings_keep_a_models_promises() {
    let mut app = new_clouds_app();
    until_baked(&mut app);
    app.insert_resource(ModelShader(include_str!("../../../examples/custom_model/rings.wesl").to_owned()));
    run_updates(&mut app, 3);
    let model = CloudModel { bottom: 620.0, top: 4580.0, map_scale: 5000.0, ..default() };
    let mut rng = StdRng::seed_from_u64(600);
    let questions: Vec<Question> = (0..40_000).map(|_| question(&mut rng, &model)).collect();
    let (mut empty, mut cloud) = (0, 0);
    for (question, answer) in questions.iter().zip(ask(&mut app, &model, &questions)) {
        let [bound, density, extinction, _, extinction_bound] = answer;
        assert!(answer.iter().all(|v| v.is_finite() && *v >= 0.0), "{question:?}: {answer:?}");
        assert!(density <= bound && extinction <= extinction_bound, "{question:?}: {answer:?}");
        empty += u32::from(bound == 0.0);
        cloud += u32::from(density > 0.0);
    }
    println!("{empty} certainly empty, {cloud} in cloud");
    assert!(empty > 10_000 && cloud > 60, "{empty} certainly empty, {cloud} in cloud");
}
