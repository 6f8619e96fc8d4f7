//! Clouds from a model of one's own: rings, in `rings.wesl`, with a 3D texture made here.
//!
//! `cargo run --example custom_model`, then change `rings.wesl` and save it.

use bevy::{
    asset::RenderAssetUsages,
    camera::Exposure,
    light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux},
    pbr::AtmosphereSettings,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
    time::common_conditions::on_timer,
};
use bevy_cumulus::{ModelShader, prelude::*};

/// Where the source is while this is developed.
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/custom_model/rings.wesl");

fn main() {
    App::new()
        // The one line that takes the built-in model's place.
        .insert_resource(ModelShader(include_str!("rings.wesl").to_owned()))
        .add_plugins((DefaultPlugins, CloudsPlugin))
        .insert_resource(CloudModel { map_scale: 12_000.0, wind: Vec3::new(15.0, 0.0, 0.0), ..default() })
        .add_systems(Startup, setup)
        .add_systems(Update, reload.run_if(on_timer(std::time::Duration::from_millis(500))))
        .run();
}

/// Takes what was saved. Whatever is in the file: it is shown if it compiles.
fn reload(mut model: ResMut<ModelShader>) {
    if let Ok(text) = std::fs::read_to_string(FILE)
        && text != model.0
    {
        model.0 = text;
    }
}

fn setup(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut slots: ResMut<CloudTextureSlots>,
    mut media: ResMut<Assets<ScatteringMedium>>,
) {
    slots.billow = Some(images.add(gyroid(32)));
    let earth = media.add(ScatteringMedium::earth(256, 256));
    commands.spawn(Atmosphere::earth(earth));
    commands.spawn((
        DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() },
        Transform::from_xyz(1.0, 0.8, 1.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Transform::from_xyz(0.0, 100.0, 0.0).looking_to(Vec3::new(-0.4, 0.3, -1.0), Vec3::Y),
        Exposure { ev100: 14.0 },
        AtmosphereSettings::default(),
        CloudView::default(),
    ));
}

/// A tiling volume of tubes that wind about each other; a model may read any image in any of the slots.
fn gyroid(side: u32) -> Image {
    let texel = |k: u32| {
        let place = UVec3::new(k % side, k / side % side, k / (side * side)).as_vec3();
        let (s, c) = {
            let angles = place * (std::f32::consts::TAU * 2.0 / side as f32);
            (
                Vec3::new(angles.x.sin(), angles.y.sin(), angles.z.sin()),
                Vec3::new(angles.x.cos(), angles.y.cos(), angles.z.cos()),
            )
        };
        let value = s.dot(Vec3::new(c.y, c.z, c.x)) / 3.0 + 0.5;
        [(value * 255.0) as u8; 4]
    };
    let data = (0..side.pow(3)).flat_map(texel).collect();
    let size = Extent3d { width: side, height: side, depth_or_array_layers: side };
    Image::new(size, TextureDimension::D3, data, TextureFormat::Rgba8Unorm, RenderAssetUsages::default())
}
