//! Transparent things before, in and beyond the clouds, and what they are told of them.

use std::path::{Path, PathBuf};

use bevy::{
    asset::io::embedded::EmbeddedAssetRegistry,
    camera::{Exposure, MainPassResolutionOverride, visibility::NoFrustumCulling},
    prelude::*,
    render::{RenderApp, render_resource::AsBindGroup, sync_world::RenderEntity},
    shader::ShaderRef,
};
use bevy_cumulus::prelude::*;

use crate::support::{
    app::{cloud_pixels, new_clouds_app_with, read_image, spawn_sun, until_drawn},
    gpu::run_updates,
    half::from_half,
    scene::{CLEAR, exact, linear_pixels, settle, slab_app, spawn_box, spawn_linear},
    uniform_slab::slab_text,
};

const SIZE: UVec2 = UVec2::new(48, 32);
/// Tangent of half the default field of view, 45°.
const HALF: f32 = 0.414_213_56;
const GLASS: Vec3 = Vec3::new(0.9, 0.3, 0.1);
const ALPHA: f32 = 0.6;

fn looking_up() -> Transform {
    Transform::from_xyz(0.0, 10.0, 0.0).with_rotation(Quat::from_rotation_x(35_f32.to_radians()))
}

/// A pane of coloured glass over the whole view, so far ahead.
fn spawn_glass(app: &mut App, camera: Transform, distance: f32) -> Entity {
    let pane = camera * Transform::from_xyz(0.0, 0.0, -distance);
    let glass = spawn_box(app, Vec3::new(2.0 * distance, 2.0 * distance, 0.01), pane, GLASS);
    let handle = app.world().get::<MeshMaterial3d<StandardMaterial>>(glass).expect("a material").0.clone();
    let mut materials = app.world_mut().resource_mut::<Assets<StandardMaterial>>();
    let mut material = materials.get_mut(&handle).expect("it is there");
    material.alpha_mode = AlphaMode::Blend;
    material.base_color.set_alpha(ALPHA);
    drop(material);
    app.world_mut().entity_mut(glass).insert(NoFrustumCulling);
    glass
}

fn over(glass: Vec3, behind: Vec3) -> Vec3 {
    glass * ALPHA + behind * (1.0 - ALPHA)
}

#[test]
fn transparent_things_stand_before_or_behind_the_clouds() {
    // A layer from 1.5 to 2.5 km, seen from below: glass before it, in it and beyond it.
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let view = spawn_linear(&mut app, SIZE, looking_up());
    let exposure = app.world().get::<Exposure>(view.camera).unwrap().exposure();
    let near = spawn_glass(&mut app, looking_up(), 200.0);
    let within = spawn_glass(&mut app, looking_up(), 3500.0);
    let beyond = spawn_glass(&mut app, looking_up(), 9000.0);
    until_drawn(&mut app);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        for order in [CloudOrder::Sorted, CloudOrder::BeforeTransparent, CloudOrder::AfterTransparent] {
            app.world_mut().entity_mut(view.camera).insert((msaa, CloudView { order, ..default() }));
            for (glass, name, covered) in [
                (near, "near", order == CloudOrder::AfterTransparent),
                (within, "within", order == CloudOrder::AfterTransparent),
                (beyond, "beyond", order != CloudOrder::BeforeTransparent),
            ] {
                for thing in [near, within, beyond] {
                    let visible = if thing == glass { Visibility::Visible } else { Visibility::Hidden };
                    app.world_mut().entity_mut(thing).insert(visible);
                }
                settle(&mut app);
                let what = format!("{order:?}, {msaa:?}, {name}");
                for (cloud, shown) in cloud_pixels(&app, &view).iter().zip(linear_pixels(&app, &view)) {
                    assert!(cloud.w < 0.7, "{what}: no cloud");
                    let clouds_over = |behind: Vec3| behind * cloud.w + cloud.truncate() * exposure;
                    let expected =
                        if covered { clouds_over(over(GLASS, CLEAR)) } else { over(GLASS, clouds_over(CLEAR)) };
                    let off = (shown - expected).abs().max_element();
                    assert!(off < 4e-3 * expected.max_element().max(1.0), "{what}: {shown}, not {expected}");
                }
            }
        }
    }
    // Among themselves things keep their order: far, clouds, near.
    app.world_mut().entity_mut(view.camera).insert((Msaa::Off, CloudView::default()));
    for thing in [near, beyond] {
        app.world_mut().entity_mut(thing).insert(Visibility::Visible);
    }
    app.world_mut().entity_mut(within).insert(Visibility::Hidden);
    settle(&mut app);
    for (cloud, shown) in cloud_pixels(&app, &view).iter().zip(linear_pixels(&app, &view)) {
        let expected = over(GLASS, over(GLASS, CLEAR) * cloud.w + cloud.truncate() * exposure);
        assert!(shown.abs_diff_eq(expected, 4e-3 * expected.max_element().max(1.0)), "{shown}, not {expected}");
    }
}

/// A user's material: of one colour, faded by the clouds before it.
#[derive(Asset, TypePath, AsBindGroup, Clone)]
struct Faded {
    #[texture(0, sample_type = "float", filterable = false)]
    clouds: Handle<Image>,
}

const FADED: &str = "
import bevy_pbr::render::{forward_io::VertexOutput, mesh_view_bindings::view};
import bevy_cumulus::cloud_fade;

@group(constants::MATERIAL_BIND_GROUP) @binding(0) var clouds: texture_2d<f32>;

@fragment
fn fragment(mesh: VertexOutput) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(mesh.position.xy - view.viewport.xy);
    let distance = length(mesh.world_position.xyz - view.world_position);
    return vec4(8.0, 8.0, 8.0, cloud_fade(textureLoad(clouds, pixel, 0), distance));
}
";

impl Material for Faded {
    fn fragment_shader() -> ShaderRef {
        "embedded://behaviour/faded.wesl".into()
    }
    fn alpha_mode(&self) -> AlphaMode {
        AlphaMode::Blend
    }
}

fn slant(k: usize) -> f32 {
    let at = Vec2::new((k as u32 % SIZE.x) as f32, (k as u32 / SIZE.x) as f32) + 0.5;
    ((at - 0.5 * SIZE.as_vec2()) * (2.0 * HALF / SIZE.y as f32)).extend(1.0).length()
}

#[test]
fn a_material_fades_by_the_clouds_before_it() {
    // In a fog without end, where transmittance is e^(−σd) (Beer–Lambert, thesis equation 2.2); then below a layer.
    const EXTINCTION: f32 = 0.002;
    let fog = slab_text(-300.0, 3000.0, EXTINCTION);
    let insert = move |app: &mut App| {
        app.insert_resource(fog.clone());
    };
    let mut app = new_clouds_app_with((insert, CloudsPlugin, MaterialPlugin::<Faded>::default()));
    app.insert_resource(exact(MarchResolution::Full));
    spawn_sun(&mut app, Vec3::new(-0.4, -1.0, -0.3));
    app.world().resource::<EmbeddedAssetRegistry>().insert_asset(
        PathBuf::new(),
        Path::new("behaviour/faded.wesl"),
        FADED.as_bytes(),
    );
    let camera = Transform::from_xyz(0.0, 1000.0, 0.0);
    let view = spawn_linear(&mut app, SIZE, camera);
    let clouds = app.world_mut().resource_mut::<Assets<Image>>().add(CloudDepth::image(SIZE.x, SIZE.y));
    app.world_mut().entity_mut(view.camera).insert(CloudDepth(clouds.clone()));
    let thing = spawn_box(&mut app, Vec3::new(4000.0, 4000.0, 0.01), camera, Vec3::ONE);
    let material = app.world_mut().resource_mut::<Assets<Faded>>().add(Faded { clouds: clouds.clone() });
    app.world_mut()
        .entity_mut(thing)
        .remove::<MeshMaterial3d<StandardMaterial>>()
        .insert((MeshMaterial3d(material), NoFrustumCulling));
    until_drawn(&mut app);
    let exposure = app.world().get::<Exposure>(view.camera).unwrap().exposure();
    for resolution in [MarchResolution::Full, MarchResolution::Quarter] {
        app.insert_resource(exact(resolution));
        for distance in [30.0, 200.0, 500.0, 1200.0] {
            app.world_mut().entity_mut(thing).insert(Transform::from_xyz(0.0, 1000.0, -distance));
            settle(&mut app);
            let what = format!("{resolution:?}, {distance} m");
            let published: Vec<[f64; 4]> = bytemuck::pod_collect_to_vec::<u8, [u16; 4]>(&read_image(&app, &clouds))
                .into_iter()
                .map(|texel| texel.map(from_half))
                .collect();
            for (k, (cloud, shown)) in cloud_pixels(&app, &view).iter().zip(linear_pixels(&app, &view)).enumerate() {
                let [through, mean, front, one] = published[k].map(|x| x as f32);
                assert!((through - cloud.w).abs() < 2e-3 && one == 1.0, "{what}: {through} for {}", cloud.w);
                assert!(front < 0.001, "{what}: the fog begins {front} km ahead");
                // The mean of 1/σ, as long as the fog is.
                assert!((mean - 0.001 / EXTINCTION).abs() < 0.03, "{what}: mean distance {mean} km");
                let fade = (-EXTINCTION * distance * slant(k)).exp();
                let behind = CLEAR * cloud.w + cloud.truncate() * exposure;
                let found = ((shown - behind) / (8.0 - behind)).x;
                assert!((found - fade).abs() < 0.03, "{what}: faded to {found}, and {fade} is right");
            }
        }
    }
}

#[test]
fn clouds_depth_ends_at_the_scene_and_is_empty_without_clouds() {
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let view = spawn_linear(&mut app, SIZE, looking_up());
    let clouds = app.world_mut().resource_mut::<Assets<Image>>().add(CloudDepth::image(SIZE.x, SIZE.y));
    app.world_mut().entity_mut(view.camera).insert(CloudDepth(clouds.clone()));
    // A wall over the left half.
    let wall = looking_up() * Transform::from_xyz(-100.0, 0.0, -200.0);
    spawn_box(&mut app, Vec3::new(200.0, 400.0, 0.1), wall, Vec3::ONE);
    until_drawn(&mut app);
    settle(&mut app);
    let texels: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read_image(&app, &clouds));
    for (k, texel) in texels.into_iter().enumerate() {
        let [through, mean, front, _] = texel.map(from_half);
        let (x, y) = (k as u32 % SIZE.x, k as u32 / SIZE.x);
        let up = Vec3::new(0.0, 0.5 - (y as f32 + 0.5) / SIZE.y as f32, 0.0).y * 2.0 * HALF;
        if x < SIZE.x / 2 {
            assert_eq!([through, mean, front], [1.0, 65504.0, 65504.0], "cloud before the wall at {x}, {y}");
        } else if x > SIZE.x / 2 {
            // Between the layer's shells, as the planet's curve has them.
            let across = ((x as f32 + 0.5) / SIZE.x as f32 - 0.5) * 2.0 * HALF * SIZE.x as f32 / SIZE.y as f32;
            let ray = looking_up().rotation * Vec3::new(across, up, -1.0).normalize();
            let [near, far] = [1490.0, 2490.0].map(|rise| f64::from(rise / ray.y) / 1000.0);
            assert!((front / near - 1.0).abs() < 0.02, "begins at {front} km, not {near}, at {x}, {y}");
            assert!(mean > front && mean < 1.01 * far, "mean {mean} km, from {front} to {far}");
        }
    }
}

#[test]
fn a_wire_in_fog_has_no_halo_and_its_share_of_fog() {
    // A bright wire thinner than a texel of any coarse resolution, in fog that ends nowhere, at several distances.
    const EXTINCTION: f32 = 0.003;
    const WIRE: Vec3 = Vec3::new(6.0, 5.0, 4.0);
    let mut app = slab_app(-300.0, 3000.0, EXTINCTION);
    let camera = Transform::from_xyz(0.0, 1000.0, 0.0);
    let view = spawn_linear(&mut app, SIZE, camera);
    let exposure = app.world().get::<Exposure>(view.camera).unwrap().exposure();
    let wire = spawn_box(&mut app, Vec3::ONE, camera, WIRE);
    until_drawn(&mut app);
    let show = |app: &mut App, visible| {
        let visibility = if visible { Visibility::Visible } else { Visibility::Hidden };
        app.world_mut().entity_mut(wire).insert(visibility);
        settle(app);
    };
    for resolution in [MarchResolution::Full, MarchResolution::Half, MarchResolution::Quarter] {
        app.insert_resource(exact(resolution));
        show(&mut app, false);
        let open = linear_pixels(&app, &view);
        show(&mut app, true);
        for distance in [20.0, 120.0, 400.0] {
            let pixel = 2.0 * HALF / SIZE.y as f32 * distance;
            // Upright, one pixel wide, through the centres of one column.
            let middle = Transform::from_xyz(5.5 * pixel, 1000.0, -distance);
            app.world_mut().entity_mut(wire).insert(middle.with_scale(Vec3::new(
                1.02 * pixel,
                4.0 * distance,
                0.01 * pixel,
            )));
            settle(&mut app);
            let what = format!("{resolution:?}, {distance} m");
            let (shown, clouds) = (linear_pixels(&app, &view), cloud_pixels(&app, &view));
            let mut pixels = 0;
            for (k, ((shown, open), cloud)) in shown.iter().zip(&open).zip(&clouds).enumerate() {
                if k as u32 % SIZE.x != 29 {
                    // Its neighbours must not know of it.
                    assert!(shown.abs_diff_eq(*open, 4e-3), "{what}: a halo at {k}: {shown} instead of {open}");
                    continue;
                }
                pixels += 1;
                let through = (-EXTINCTION * distance * slant(k)).exp();
                assert!((cloud.w - through).abs() < 0.03, "{what}: {} of the wire is seen, not {through}", cloud.w);
                // The fog shines alike everywhere, so its light is in proportion to what it hides.
                let fog = *open * (1.0 - through);
                let expected = WIRE * through + fog;
                let off = (*shown - expected).abs().max_element() / expected.max_element();
                assert!(off < 0.12, "{what}: {shown}, not {expected}");
                let alone = cloud.truncate() * exposure;
                let off = (alone - fog).abs().max_element();
                // Where no surface is, some light of the sky behind comes through the fog, which is a little darker than it.
                assert!(off < 0.3 * fog.max_element().max(0.5), "{what}: {alone}, not {fog}");
            }
            assert_eq!(pixels, SIZE.y);
        }
    }
}

#[test]
fn where_the_scene_is_drawn_small_clouds_are_too() {
    // What an upscaler such as DLSS asks for: a main pass smaller than the view.
    let small = UVec2::new(24, 16);
    let mut app = slab_app(1500.0, 2500.0, 0.0006);
    let whole = spawn_linear(&mut app, SIZE, looking_up());
    let alone = spawn_linear(&mut app, small, looking_up());
    until_drawn(&mut app);
    let entity = app.world().get::<RenderEntity>(whole.camera).expect("it is rendered").id();
    app.sub_app_mut(RenderApp).world_mut().entity_mut(entity).insert(MainPassResolutionOverride(small));
    for order in [CloudOrder::Sorted, CloudOrder::AfterTransparent] {
        for view in [&whole, &alone] {
            app.world_mut().entity_mut(view.camera).insert(CloudView { order, ..default() });
        }
        settle(&mut app);
        run_updates(&mut app, 2);
        let (picture, expected) = (linear_pixels(&app, &whole), linear_pixels(&app, &alone));
        for y in 0..small.y {
            for x in 0..small.x {
                let [found, right] = [picture[(y * SIZE.x + x) as usize], expected[(y * small.x + x) as usize]];
                assert!(!right.abs_diff_eq(CLEAR, 1e-2), "no cloud at {x}, {y}");
                assert!(found.abs_diff_eq(right, 4e-3), "{order:?} at {x}, {y}: {found}, not {right}");
            }
        }
        let beside = picture[(SIZE.x * SIZE.y - 1) as usize];
        assert!(beside.abs_diff_eq(CLEAR, 1e-3), "{order:?}: clouds beside the scene: {beside}");
    }
}
