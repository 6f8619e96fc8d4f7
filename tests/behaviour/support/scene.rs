//! A uniform slab of cloud, seen in linear light: what comes out can be computed by hand.

use bevy::{
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    prelude::*,
    render::{
        RenderApp,
        render_resource::{TextureFormat, TextureUsages},
        sync_world::RenderEntity,
    },
};
use bevy_cumulus::prelude::*;

use super::{
    app::{Sky, View, read_image, spawn_sun, spawn_view, until_drawn},
    gpu::{pipelines_are_there, run_until, run_updates},
    shared::SharedApp,
    uniform_slab::UniformSlab,
};

/// What the cameras of this module see where nothing is.
pub const CLEAR: Vec3 = Vec3::new(0.1, 0.2, 0.3);

/// An app whose only cloud is a uniform slab between two altitudes (m), with this extinction (1/m), and a sun that is not
/// overhead. Frames stand alone, without offsets.
pub fn slab_app(bottom: f32, top: f32, extinction: f32) -> SharedApp {
    let mut app = UniformSlab::new(bottom, top, extinction).app();
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    app
}

/// A quality at which every frame stands alone, has no noise and stops nowhere.
pub fn exact(resolution: MarchResolution) -> CloudQuality {
    CloudQuality {
        resolution,
        offsets: false,
        temporal: TemporalMode::Off,
        transmittance_stop: 0.0,
        light_steps: 2,
        ..CloudQuality::high()
    }
}

/// A quality of long steps, a ray a pixel and a window of eight frames, whose noise shows what is held.
pub fn noisy() -> CloudQuality {
    CloudQuality { resolution: MarchResolution::Full, step: 200.0, window: 8, ..CloudQuality::high() }
}

/// A camera with clouds over [`CLEAR`] whose target holds linear light as it is (`Rgba32Float`), without tone mapping.
pub fn spawn_linear(app: &mut App, size: UVec2, transform: Transform) -> View {
    let mut view = spawn_view(app, size, transform, Sky::Black);
    let mut target = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba32Float, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let world = app.world_mut();
    view.target = world.resource_mut::<Assets<Image>>().add(target);
    let clear = Color::linear_rgb(CLEAR.x, CLEAR.y, CLEAR.z);
    world.entity_mut(view.camera).insert((
        bevy::camera::RenderTarget::from(view.target.clone()),
        Camera { clear_color: ClearColorConfig::Custom(clear), ..default() },
        Tonemapping::None,
        DebandDither::Disabled,
    ));
    view
}

/// The picture of the last frame in linear light, row by row from the top left.
pub fn linear_pixels(app: &App, view: &View) -> Vec<Vec3> {
    let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_image(app, &view.target));
    texels.into_iter().map(|[r, g, b, _]| Vec3::new(r, g, b)).collect()
}

/// Enough frames for a change to be in the picture: new pipelines, meshes and textures included.
pub fn settle(app: &mut App) {
    run_updates(app, 3);
    if !pipelines_are_there(app) {
        run_until(app, "new pipelines", 100, |app| pipelines_are_there(app));
        run_updates(app, 2);
    }
}

/// The picture with this view's clouds turned off; they are on again afterwards.
pub fn without_clouds(app: &mut App, view: &View) -> Vec<Vec3> {
    enable(app, view, false);
    let bare = linear_pixels(app, view);
    enable(app, view, true);
    bare
}

/// Turns this view's clouds on or off, and waits.
pub fn enable(app: &mut App, view: &View, enabled: bool) {
    app.world_mut().entity_mut(view.camera).insert(CloudView { enabled, ..default() });
    settle(app);
}

/// Steps of each pixel's ray, as the picture of [`CloudDebugView::Steps`] tells of them: to half a per cent. For a view
/// of [`spawn_linear`].
pub fn steps(app: &mut App, view: &View) -> Vec<f32> {
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = CloudDebugView::Steps;
    run_updates(app, 1);
    until_drawn(app);
    run_updates(app, 3);
    let most = 1.0 + app.world().resource::<CloudQuality>().max_steps as f32;
    let of = |p: &Vec3| {
        let t = match *p {
            Vec3 { x, z, .. } if x <= 0.0 => z,
            Vec3 { x, .. } if x < 1.0 => 1.0 + x,
            Vec3 { y, .. } if y < 1.0 => 2.0 + y,
            Vec3 { z, .. } => 3.0 + z,
        };
        most.powf(0.25 * t) - 1.0
    };
    let counts = linear_pixels(app, view).iter().map(of).collect();
    app.world_mut().get_mut::<CloudView>(view.camera).expect("it shows clouds").debug = CloudDebugView::None;
    until_drawn(app);
    settle(app);
    counts
}

/// Spawns an unlit box of one colour.
pub fn spawn_box(app: &mut App, size: Vec3, transform: Transform, colour: Vec3) -> Entity {
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::from_size(size));
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        base_color: Color::linear_rgb(colour.x, colour.y, colour.z),
        unlit: true,
        ..default()
    });
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), transform)).id()
}

/// Names of this crate's components on the camera's entity in the render world.
pub fn render_components(app: &App, camera: Entity) -> Vec<String> {
    let Some(entity) = app.world().get::<RenderEntity>(camera) else { return Vec::new() };
    let world = app.sub_app(RenderApp).world();
    let infos = world.inspect_entity(entity.id()).expect("the camera is in the render world");
    infos.map(|(_, info)| info.name().to_string()).filter(|name| name.contains("cumulus")).collect()
}

/// Greatest difference of two pictures in any pixel and channel.
pub fn greatest_difference(a: &[Vec3], b: &[Vec3]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
}
