//! A material that fades into the clouds: balloons of glass at all distances, some before clouds, some in them and some
//! behind.
//!
//! Transparent things are not in the depth buffer, so clouds cannot end at them. Instead `CloudDepth` says where the
//! clouds are, before anything transparent is drawn, and the material asks how much of them is before it.

use bevy::{
    asset::embedded_asset, camera::visibility::NoFrustumCulling, prelude::*, render::render_resource::AsBindGroup,
    shader::ShaderRef,
};
use bevy_cumulus::prelude::*;

/// Coloured glass that knows of the clouds.
#[derive(Asset, TypePath, AsBindGroup, Clone)]
struct Glass {
    #[uniform(0)]
    color: LinearRgba,
    #[texture(1, sample_type = "float", filterable = false)]
    clouds: Handle<Image>,
}

impl Material for Glass {
    fn fragment_shader() -> ShaderRef {
        "embedded://cloud_depth/cloud_depth.wesl".into()
    }
    fn alpha_mode(&self) -> AlphaMode {
        AlphaMode::Blend
    }
}

fn main() {
    let mut app = App::new();
    app.add_plugins((DefaultPlugins, CloudsPlugin, MaterialPlugin::<Glass>::default()));
    embedded_asset!(app, "examples", "cloud_depth.wesl");
    app.add_systems(Startup, setup).add_systems(Update, (fit_to_window, fly)).run();
}

/// The image that the clouds' depth is written to: as large as the window.
#[derive(Resource)]
struct Clouds(Handle<Image>);

fn setup(
    mut commands: Commands,
    window: Single<&Window>,
    mut images: ResMut<Assets<Image>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut glasses: ResMut<Assets<Glass>>,
) {
    let clouds = images.add(CloudDepth::image(window.physical_width(), window.physical_height()));
    commands.insert_resource(Clouds(clouds.clone()));
    commands.spawn((
        Camera3d::default(),
        CloudView::default(),
        CloudDepth(clouds.clone()),
        bevy::camera::Exposure { ev100: 13.0 },
        Transform::from_xyz(0.0, 2000.0, 0.0).looking_to(Vec3::new(1.0, 0.05, 0.0), Vec3::Y),
    ));
    commands.spawn((
        DirectionalLight { illuminance: light_consts::lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, -0.4).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let ball = meshes.add(Sphere::new(0.5));
    for k in 0..60 {
        let (distance, turn) = (150.0 * 1.07_f32.powi(k), k as f32 * 0.618);
        let color = Color::hsla(turn * 137.0 % 360.0, 0.8, 0.5, 0.7).to_linear();
        commands.spawn((
            Mesh3d(ball.clone()),
            MeshMaterial3d(glasses.add(Glass { color, clouds: clouds.clone() })),
            NoFrustumCulling,
            Transform::from_xyz(distance, 2000.0 + 0.2 * distance * turn.sin(), 0.5 * distance * (2.4 * turn).cos())
                .with_scale(Vec3::splat(0.05 * distance)),
        ));
    }
}

/// A window of another size needs another image, and the materials must hear of it.
fn fit_to_window(
    window: Single<&Window>,
    clouds: Res<Clouds>,
    mut images: ResMut<Assets<Image>>,
    mut glasses: ResMut<Assets<Glass>>,
) {
    let size = UVec2::new(window.physical_width(), window.physical_height());
    if images.get(&clouds.0).is_none_or(|image| image.size() == size) || size.min_element() == 0 {
        return;
    }
    if images.insert(&clouds.0, CloudDepth::image(size.x, size.y)).is_ok() {
        glasses.iter_mut().for_each(|_| ());
    }
}

fn fly(mut camera: Single<&mut Transform, With<CloudView>>, time: Res<Time>) {
    camera.translation.x += 40.0 * time.delta_secs();
}
