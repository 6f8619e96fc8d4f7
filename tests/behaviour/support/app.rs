//! Headless apps with clouds: a camera, a sun, and what the camera saw.

use bevy::{
    app::Plugins,
    camera::{Exposure, RenderTarget},
    light::{Atmosphere, atmosphere::ScatteringMedium, light_consts::lux},
    math::DVec3,
    pbr::AtmosphereSettings,
    prelude::*,
    render::{
        RenderApp,
        render_asset::RenderAssets,
        render_resource::{
            BufferDescriptor, BufferUsages, CommandEncoderDescriptor, TexelCopyBufferInfo, TexelCopyBufferLayout,
            TextureFormat, TextureUsages,
        },
        renderer::{RenderDevice, RenderQueue},
        texture::GpuImage,
    },
};
use bevy_cumulus::{prelude::*, testing::model_bindings, textures::CloudTextureStatus};

use super::{
    gpu::{
        app_of, app_with, assert_shaders_compile, headless_plugins, pipelines_are_there, read_mapped, run_until,
        run_updates, webgpu_limits,
    },
    shared::{SharedApp, small_settings},
};

/// What is behind the clouds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sky {
    /// Nothing.
    Black,
    /// Bevy's `Atmosphere`. Under WebGPU's limits Bevy's own passes fail validation, so there it is black as well.
    Atmosphere,
}

/// A camera that shows clouds, and where its pictures are.
#[derive(Clone)]
pub struct View {
    pub camera: Entity,
    /// The picture as shown: `Rgba8UnormSrgb`.
    pub target: Handle<Image>,
    /// The resolved clouds (see [`CloudBuffer`]).
    pub clouds: Handle<Image>,
    pub size: UVec2,
}

/// An app with clouds whose textures are as small as they may be, and whose clock stands still; nothing is in its world.
/// Tests share it, one after another.
///
/// # Panics
/// As [`app_with`], and where clouds cannot be drawn on this device.
pub fn clouds_app() -> SharedApp {
    SharedApp::of_kind("clouds", new_clouds_app)
}

/// [`clouds_app`] with a map whose texels are not as wide as the gaps between clouds: with a smaller one no air is known to
/// be empty.
pub fn clouds_of_a_larger_map() -> SharedApp {
    let textures = CloudTextures { volume_size: 32, map_size: 512, ..default() };
    SharedApp::with_textures("clouds of a larger map", textures, new_clouds_app)
}

/// [`clouds_app`], started now and for this test alone.
pub fn new_clouds_app() -> App {
    new_clouds_app_with(CloudsPlugin)
}

/// [`new_clouds_app`] with these plugins, of which [`CloudsPlugin`] must be one.
pub fn new_clouds_app_with<M>(plugins: impl Plugins<M>) -> App {
    small_clouds(app_with(plugins))
}

/// [`new_clouds_app`] with this folder for its assets.
pub fn clouds_app_in(folder: &std::path::Path) -> App {
    let assets = AssetPlugin { file_path: folder.to_string_lossy().into_owned(), ..default() };
    small_clouds(app_of(headless_plugins().set(assets), CloudsPlugin))
}

fn small_clouds(mut app: App) -> App {
    let unsupported = app.world().resource::<CloudStatus>().unsupported().map(str::to_owned);
    assert_eq!(unsupported, None, "clouds cannot be drawn on this device");
    small_settings(&mut app);
    app
}

/// Spawns a sun that shines along `light`, straight from outside the atmosphere.
pub fn spawn_sun(app: &mut App, light: Vec3) -> Entity {
    let sun = DirectionalLight { illuminance: lux::RAW_SUNLIGHT, ..default() };
    let up = if light.normalize().y.abs() > 0.99 { Vec3::Z } else { Vec3::Y };
    app.world_mut().spawn((sun, Transform::default().looking_to(light, up))).id()
}

/// Spawns a camera with clouds that draws into images of its own; with [`Sky::Atmosphere`] the first one brings the
/// atmosphere along.
pub fn spawn_view(app: &mut App, size: UVec2, transform: Transform, sky: Sky) -> View {
    let world = app.world_mut();
    let mut images = world.resource_mut::<Assets<Image>>();
    let mut target = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let target = images.add(target);
    let clouds = images.add(CloudBuffer::image(size.x, size.y));
    let camera = world
        .spawn((
            Camera3d::default(),
            Camera { clear_color: ClearColorConfig::Custom(Color::BLACK), ..default() },
            RenderTarget::from(target.clone()),
            Exposure { ev100: 13.0 },
            Msaa::Off,
            transform,
            CloudView::default(),
            CloudBuffer(clouds.clone()),
        ))
        .id();
    if sky == Sky::Atmosphere && !webgpu_limits() {
        world.entity_mut(camera).insert(AtmosphereSettings::default());
        if world.query::<&Atmosphere>().iter(world).next().is_none() {
            let medium = world.resource_mut::<Assets<ScatteringMedium>>().add(ScatteringMedium::earth(256, 256));
            world.spawn(Atmosphere::earth(medium));
        }
    }
    View { camera, target, clouds, size }
}

/// Runs frames until clouds are drawn, and all else that the camera sees; fails if that takes too long, or if a shader
/// does not compile.
pub fn until_drawn(app: &mut App) {
    // Of what there is now.
    run_updates(app, 1);
    run_until(app, "clouds are drawn", 600, |app| {
        assert_shaders_compile(app);
        app.world().resource::<CloudStatus>().is_ready() && pipelines_are_there(app)
    });
}

/// Whether the model's textures are baked, and its layers' maps made.
pub fn is_baked(app: &App) -> bool {
    !app.world().resource::<CloudTextureStatus>().baking && model_bindings(app, DVec3::ZERO).is_ok()
}

/// Runs frames until the textures that are asked for now are baked.
pub fn until_baked(app: &mut App) {
    run_until(app, "the textures are baked", 600, |app| is_baked(app));
    // Those that small sizes ask for are begun after the first ones.
    run_updates(app, 3);
    run_until(app, "the textures are baked", 600, |app| is_baked(app));
}

/// The resolved clouds of the last frame, row by row from the top left: radiance (cd/m²) and transmittance.
pub fn cloud_pixels(app: &App, view: &View) -> Vec<Vec4> {
    let bytes = read_image(app, &view.clouds);
    bytemuck::pod_collect_to_vec::<u8, [f32; 4]>(&bytes).into_iter().map(Vec4::from_array).collect()
}

/// The picture of the last frame as shown, row by row from the top left.
pub fn shown_pixels(app: &App, view: &View) -> Vec<[u8; 4]> {
    bytemuck::pod_collect_to_vec(&read_image(app, &view.target))
}

/// The texels of a 2D image on the GPU as they are now, rows tightly packed. It needs usage `COPY_SRC`.
pub fn read_image(app: &App, image: &Handle<Image>) -> Vec<u8> {
    let world = app.sub_app(RenderApp).world();
    let texture = &world.resource::<RenderAssets<GpuImage>>().get(image).expect("the image is not on the GPU").texture;
    assert!(texture.usage().contains(TextureUsages::COPY_SRC), "the image lacks the usage COPY_SRC");
    let (size, texel) = (texture.size(), texture.format().block_copy_size(None).expect("a format without a size"));
    let packed = size.width * texel;
    let padded = RenderDevice::align_copy_bytes_per_row(packed as usize) as u32;
    let device = world.resource::<RenderDevice>();
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("image readback"),
        size: u64::from(padded) * u64::from(size.height),
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), TexelCopyBufferInfo { buffer: &buffer, layout }, size);
    world.resource::<RenderQueue>().submit([encoder.finish()]);
    let rows: Vec<u8> = read_mapped(app, &buffer);
    rows.chunks(padded as usize).flat_map(|row| &row[..packed as usize]).copied().collect()
}

#[test]
fn clouds_are_drawn_over_either_sky() {
    for sky in [Sky::Black, Sky::Atmosphere] {
        let mut app = clouds_app();
        spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
        let looking = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::new(0.0, 0.4, -1.0), Vec3::Y);
        let view = spawn_view(&mut app, UVec2::new(65, 33), looking, sky);
        until_drawn(&mut app);
        run_updates(&mut app, 8);
        let pixels = cloud_pixels(&app, &view);
        assert_eq!(pixels.len(), (view.size.x * view.size.y) as usize);
        assert!(pixels.iter().all(|p| p.is_finite() && p.min_element() >= 0.0 && p.w <= 1.0), "{sky:?}");
        let (clear, cloudy) = (pixels.iter().filter(|p| p.w > 0.99), pixels.iter().filter(|p| p.w < 0.5));
        let (clear, cloudy) = (clear.count(), cloudy.count());
        assert!(clear > 20 && cloudy > 20, "{sky:?}: {clear} clear and {cloudy} cloudy pixels");
        let shown = shown_pixels(&app, &view);
        assert!(shown.iter().filter(|p| p[0] > 40).count() >= 20, "{sky:?}: nothing shines");
        // Down at the ground there is none.
        let down = looking.looking_to(Vec3::NEG_Y, Vec3::Z);
        app.world_mut().entity_mut(view.camera).insert(down);
        run_updates(&mut app, 8);
        let below = cloud_pixels(&app, &view);
        assert!(below.iter().all(|p| *p == Vec4::W), "{sky:?}: {:?}", below[0]);
    }
}
