//! The settings in bevy-inspector-egui's windows: `cargo run --example resource_inspector --features inspector`.
//!
//! They are ordinary reflected resources, so whatever shows resources shows these. What is out of its range is reported
//! in the log, and the last good value stays.
use bevy::light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux};
use bevy::{camera::Exposure, pbr::AtmosphereSettings, prelude::*, reflect::Typed};
use bevy_cumulus::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};
use bevy_inspector_egui::quick::ResourceInspectorPlugin;

fn main() {
    let title = "bevy_cumulus: resource inspector".to_owned();
    let window = Window { title, ..default() };
    App::new()
        .add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins((CloudsPlugin, EguiPlugin::default()))
        // The inspector counts on these. Bevy's feature `reflect_auto_register`, one of its defaults, does it as well.
        .register_type::<Name>()
        .register_type::<bevy::render::view::ColorGrading>()
        .add_plugins((
            inspector::<CloudModel>([8.0, 8.0], [290.0, 300.0]),
            inspector::<CloudLighting>([8.0, 370.0], [290.0, 300.0]),
            inspector::<CloudQuality>([960.0, 8.0], [290.0, 300.0]),
            inspector::<CloudTextures>([960.0, 370.0], [290.0, 300.0]),
            inspector::<CloudTextureSlots>([330.0, 520.0], [290.0, 150.0]),
            inspector::<CloudClock>([650.0, 520.0], [270.0, 150.0]),
        ))
        .add_systems(Startup, setup)
        .run();
}

/// A window over the resource, at this place and of this size.
///
/// `ResourceInspectorPlugin` alone will do, but opens its window as small as can be. Egui remembers windows by their
/// titles, so one that is drawn before it leaves place and size to it.
fn inspector<R>(place: [f32; 2], size: [f32; 2]) -> impl Fn(&mut App)
where
    R: Resource<Mutability = bevy::ecs::component::Mutable> + Reflect + Typed,
{
    let first = move |mut contexts: EguiContexts| -> Result {
        egui::Window::new(R::type_ident().unwrap_or_default())
            .default_pos(place)
            .default_size(size)
            .show(contexts.ctx_mut()?, |ui| ui.allocate_space(ui.available_size()));
        Ok(())
    };
    move |app: &mut App| {
        app.add_systems(EguiPrimaryContextPass, first.run_if(run_once))
            .add_plugins(ResourceInspectorPlugin::<R>::default().run_if(not(run_once)));
    }
}

fn setup(mut commands: Commands, mut media: ResMut<Assets<ScatteringMedium>>) {
    let earth = media.add(ScatteringMedium::earth(256, 256));
    commands.spawn(Atmosphere::earth(earth));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 1.0, -0.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 2.0, 0.0).looking_to(Vec3::new(0.0, 0.3, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}
