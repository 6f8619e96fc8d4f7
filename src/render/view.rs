//! From the main world to what one view's passes need.

use bevy::{
    camera::MainPassResolutionOverride,
    math::DVec3,
    pbr::{ExtractedAtmosphere, ExtractedDirectionalLight},
    prelude::*,
    render::{
        Extract,
        camera::ExtractedCamera,
        render_resource::{TextureUsages, UniformBuffer},
        renderer::{RenderDevice, RenderQueue},
        sync_world::RenderEntity,
        view::{ExtractedView, Msaa},
    },
};

use super::{
    CloudBuffer, CloudDepth, CloudFrame, CloudNoise,
    bind_groups::{CloudBindGroups, SkyLightBuffer},
    frame::{FrameInput, FrameUniform, Sun, marched_size, texel_angle},
    history::{CloudHistory, HistoryKey},
    phase_slots::PhaseSlots,
    pipelines::DrawnInto,
    reproject::{HeldUniform, Pose},
    versions::{Baked, Versions},
    winds::Winds,
    zones::{ExtractedZones, zones_around},
};
use crate::{
    model::{MAX_ZONES, ModelSettings, ModelUniform, TangentFrame, TexelSizes, decks},
    phases::ReadyTables,
    reference::planet::{Planet, disc_size},
    settings::{
        CloudDebugView, CloudLayers, CloudLighting, CloudModel, CloudOrder, CloudPhase, CloudQuality, CloudSettings,
        CloudView, CloudWeather, GoodPhases, GoodSettings, LightMix, Validate,
    },
    textures::CloudTextureViews,
};

/// The settings of this frame.
#[derive(Resource, Default)]
pub(crate) struct ExtractedClouds {
    pub settings: CloudSettings,
    /// Phase functions beside the lighting's own.
    phases: Vec<CloudPhase>,
    /// What of the lighting its fields do not say, while a transition changes it.
    light: Option<LightMix>,
    pub(super) tables: ReadyTables,
    /// Counts changes that make held frames wrong.
    pub(super) version: u64,
    /// Counts those by transitions, which the temporal filter follows and the path tracer does not.
    pub(super) transitions: u64,
    /// How fast a transition moves outlines (m/s).
    outline_speed: f32,
}

impl ExtractedClouds {
    /// Phase functions and octaves of the light as it is shown: a debug view's change of it goes before a transition's.
    fn light_mix(&self, shown: &CloudLighting) -> LightMix {
        let same = shown.octaves == self.settings.lighting.octaves && shown.phase == self.settings.lighting.phase;
        self.light.clone().filter(|_| same).unwrap_or_else(|| shown.into())
    }
}

/// A camera that shows clouds.
#[derive(Component, Clone, Debug)]
pub(crate) struct ExtractedCloudView {
    quality: CloudQuality,
    reset: u32,
    pub debug: CloudDebugView,
    pub order: CloudOrder,
    pub buffer: Option<AssetId<Image>>,
    pub depth: Option<AssetId<Image>>,
    pub frame: Option<AssetId<Image>>,
    pub noise: Option<AssetId<Image>>,
}

impl ExtractedCloudView {
    pub fn is_path_traced(&self) -> bool {
        self.quality.is_path_traced()
    }

    /// What its clouds are drawn into.
    pub fn drawn_into(&self, msaa: Msaa) -> DrawnInto {
        match self.order {
            CloudOrder::Sorted | CloudOrder::BeforeTransparent => DrawnInto::TransparentPass(msaa.samples()),
            CloudOrder::AfterTransparent => DrawnInto::Colour,
        }
    }
}

/// A view's uniforms.
#[derive(Component, Default)]
pub(crate) struct CloudUniforms {
    pub frame: UniformBuffer<FrameUniform>,
    pub held: UniformBuffer<HeldUniform>,
    pub model: UniformBuffer<ModelUniform>,
    pub world_from_local: UniformBuffer<Mat4>,
}

type CameraItems = (
    RenderEntity,
    &'static Camera,
    Option<&'static CloudView>,
    Option<&'static CloudBuffer>,
    Option<&'static CloudDepth>,
    Option<&'static CloudFrame>,
    Option<&'static CloudNoise>,
);

/// What a view has of ours while it shows clouds.
type Ours = (ExtractedCloudView, CloudUniforms, CloudHistory, CloudBindGroups, SkyLightBuffer);

/// Runs with every new device: what views hold belongs to the one that was lost.
pub(crate) fn forget_lost_device(mut commands: Commands, views: Query<Entity, With<ExtractedCloudView>>) {
    for view in &views {
        commands.entity(view).remove::<Ours>();
    }
}

pub(crate) fn extract_settings(
    good: Extract<Res<GoodSettings>>,
    phases: Extract<Res<GoodPhases>>,
    tables: Extract<Res<ReadyTables>>,
    weather: Extract<Option<Res<CloudWeather>>>,
    mut out: ResMut<ExtractedClouds>,
) {
    let light = weather.as_ref().and_then(|weather| weather.light());
    if out.light.as_ref() != light {
        out.light = light.cloned();
    }
    let weather = weather.as_ref().filter(|weather| weather.has_moved());
    out.outline_speed = weather.map_or(0.0, |weather| weather.outline_speed(good.0.clock.seconds) as f32);
    if weather.is_some() {
        // As when the sun moves, frames held are still of use.
        out.settings.model.clone_from(&good.0.model);
        out.settings.layers.clone_from(&good.0.layers);
        out.settings.lighting.clone_from(&good.0.lighting);
        out.phases.clone_from(&phases.0);
        out.tables.clone_from(&tables);
        out.transitions += 1;
    }
    // Time and a shifted origin move what is seen; frames held are moved along.
    out.settings.clock.clone_from(&good.0.clock);
    out.settings.model.world_offset = good.0.model.world_offset;
    if out.settings != good.0 || out.phases != phases.0 {
        out.settings.clone_from(&good.0);
        out.phases.clone_from(&phases.0);
        out.version += 1;
    }
    if out.tables.generation != tables.generation {
        out.tables.clone_from(&tables);
        out.version += 1;
    }
}

pub(crate) fn extract_views(
    mut commands: Commands,
    cameras: Extract<Query<CameraItems>>,
    good: Extract<Res<GoodSettings>>,
    had: Query<(), With<ExtractedCloudView>>,
    mut warned: Local<Option<String>>,
) {
    for (entity, camera, view, buffer, depth, frame, noise) in &cameras {
        let Some(view) = view.filter(|v| v.enabled && camera.is_active) else {
            if had.contains(entity) {
                commands.entity(entity).remove::<Ours>();
            }
            continue;
        };
        let mut quality = good.0.quality.clone();
        match (view.validate(), &view.quality) {
            (Ok(()), Some(own)) => quality.clone_from(own),
            (Ok(()), None) => {}
            (Err(error), _) => {
                let text = error.to_string();
                if warned.as_ref() != Some(&text) {
                    error!("clouds: {text}; this view uses the resource's quality");
                    *warned = Some(text);
                }
            }
        }
        view.debug.change_quality(&mut quality);
        commands.entity(entity).insert(ExtractedCloudView {
            quality,
            reset: view.reset,
            debug: view.debug,
            order: view.order,
            buffer: buffer.map(|b| b.0.id()),
            depth: depth.map(|d| d.0.id()),
            frame: frame.map(|f| f.0.id()),
            noise: noise.map(|n| n.0.id()),
        });
    }
}

/// The march reads the depth buffer.
pub(crate) fn request_depth(mut cameras: Query<&mut Camera3d, With<ExtractedCloudView>>) {
    for mut camera in &mut cameras {
        camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
    }
}

fn brightest_sun(lights: &Query<&ExtractedDirectionalLight>) -> Sun {
    lights
        .iter()
        .map(|light| Sun {
            direction: light.transform.back().as_vec3(),
            illuminance: light.color.to_vec3() * light.illuminance,
            angular_size: disc_size(light.sun_disk_angular_size),
        })
        .filter(|sun| sun.direction.is_finite() && sun.illuminance.is_finite())
        .max_by(|a, b| a.illuminance.element_sum().total_cmp(&b.illuminance.element_sum()))
        // Without a sun only the sky's light is left; its direction does not matter then.
        .unwrap_or(Sun { direction: Vec3::Y, ..default() })
}

/// Why a view cannot show clouds.
fn refusal(view: &ExtractedView, space: Option<&TangentFrame>) -> Option<&'static str> {
    if view.clip_from_view.w_axis.w == 1.0 {
        Some("its projection is orthographic, and clouds need a perspective one")
    } else if !view.clip_from_view.is_finite() || !view.clip_from_view.inverse().is_finite() {
        Some("its projection cannot be inverted (near plane 0, or a field that is not a number?)")
    } else if space.is_none() || !view.world_from_view.rotation().is_finite() {
        Some("its transform is not a number, or it sits at the planet's centre")
    } else {
        None
    }
}

#[derive(bevy::ecs::query::QueryData)]
#[query_data(mutable)]
pub(crate) struct PreparedView {
    entity: Entity,
    cloud: &'static ExtractedCloudView,
    view: &'static ExtractedView,
    camera: &'static ExtractedCamera,
    msaa: &'static Msaa,
    small: Option<&'static MainPassResolutionOverride>,
    atmosphere: Option<&'static ExtractedAtmosphere>,
    history: Option<&'static mut CloudHistory>,
    /// Of the last frame.
    groups: Option<&'static CloudBindGroups>,
    uniforms: Option<&'static mut CloudUniforms>,
}

impl PreparedViewItem<'_, '_> {
    /// What the scene is drawn into: less than the view where it is enlarged later.
    fn drawn_viewport(&self) -> UVec4 {
        let whole = self.view.viewport;
        self.small.map_or(whole, |size| UVec4::new(whole.x, whole.y, size.x.min(whole.z), size.y.min(whole.w)))
    }
}

pub(crate) fn prepare_views(
    mut commands: Commands,
    mut views: Query<PreparedView>,
    lights: Query<&ExtractedDirectionalLight>,
    clouds: Res<ExtractedClouds>,
    textures: Res<CloudTextureViews>,
    zones: Res<ExtractedZones>,
    mut baked: Local<Baked>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut warned: Local<bevy::platform::collections::HashSet<Entity>>,
    mut crowded: Local<bool>,
) {
    let Some(sizes) = TexelSizes::of(&textures) else { return };
    let sun = brightest_sun(&lights);
    baked.follow(textures.generation, clouds.outline_speed > 0.0);
    for mut item in &mut views {
        let viewport = item.drawn_viewport();
        if viewport.z == 0 || viewport.w == 0 {
            commands.entity(item.entity).remove::<(CloudHistory, CloudUniforms, CloudBindGroups)>();
            continue;
        }
        let space = space_below(item.view, item.atmosphere, &clouds.settings);
        if let Some(reason) = refusal(item.view, space.as_ref()) {
            if warned.insert(item.entity) {
                warn!("clouds: camera {} shows no clouds: {reason}", item.entity);
            }
            commands.entity(item.entity).remove::<(CloudHistory, CloudUniforms, CloudBindGroups)>();
            continue;
        }
        warned.remove(&item.entity);
        let Some(space) = space else { continue };
        let (key, pose) = window_state(
            &item,
            &clouds,
            Versions::of(&clouds, &baked, &zones, item.cloud.is_path_traced()),
            &space,
            sun,
        );
        // Only a frame that was drawn counts towards a window.
        let drawn = item.groups.is_some_and(|groups| groups.ready);
        let mut first = None;
        let history = match &mut item.history {
            Some(history) => {
                history.advance(&device, key, pose, drawn);
                &**history
            }
            None => first.insert(CloudHistory::new(&device, key, pose)),
        };
        let (window, held) = (history.frame, history.held_uniform());
        let (model, layers, lighting) = shown_settings(&clouds.settings, item.cloud.debug);
        let light = clouds.light_mix(&lighting);
        let phases = PhaseSlots::new(&lighting, &clouds.phases, &light, &clouds.tables);
        let frame = FrameUniform::new(&FrameInput {
            clip_from_view: item.view.clip_from_view,
            world_from_view: pose.rotation,
            viewport,
            space: &space,
            sun,
            exposure: item.camera.exposure,
            quality: &item.cloud.quality,
            lighting: &lighting,
            highest_horizon: layers.highest_horizon(space.radius),
            octaves: light.octaves,
            phases: &phases,
            window,
            debug: item.cloud.debug,
        });
        let (around, too_many) = zones_around(&zones.zones, pose.position, &space, frame.reach().into());
        if too_many && !*crowded {
            *crowded = true;
            warn!("clouds: camera {} has more than {MAX_ZONES} zones around it; the nearest count", item.entity);
        }
        let model = ModelUniform::new(
            &ModelSettings { model: &model, layers: &layers, zones: &around },
            clouds.settings.clock.seconds,
            &space,
            sizes,
        );
        let world_from_local = Mat4::from_quat(space.local_from_world.inverse().as_quat());
        let mut own = None;
        let uniforms = match &mut item.uniforms {
            Some(uniforms) => &mut **uniforms,
            None => own.insert(CloudUniforms::default()),
        };
        uniforms.frame.set(frame);
        uniforms.held.set(held);
        uniforms.model.set(model);
        uniforms.world_from_local.set(world_from_local);
        uniforms.frame.write_buffer(&device, &queue);
        uniforms.held.write_buffer(&device, &queue);
        uniforms.model.write_buffer(&device, &queue);
        uniforms.world_from_local.write_buffer(&device, &queue);
        let mut entity = commands.entity(item.entity);
        if let Some(history) = first {
            entity.insert(history);
        }
        if let Some(uniforms) = own {
            entity.insert(uniforms);
        }
    }
}

/// The settings with a debug view's changes made to them.
fn shown_settings(settings: &CloudSettings, debug: CloudDebugView) -> (CloudModel, CloudLayers, CloudLighting) {
    let (mut model, mut lighting) = (settings.model.clone(), settings.lighting.clone());
    debug.change_model(&mut model);
    debug.change_lighting(&mut lighting);
    (model, settings.layers.clone(), lighting)
}

/// The planet of the scene's atmosphere, else Bevy's default.
pub(crate) fn planet(atmosphere: Option<&ExtractedAtmosphere>, offset: DVec3) -> Planet {
    atmosphere.map_or_else(Planet::default, |a| {
        let at = a.world_to_atmosphere.inverse().w_axis.truncate();
        Planet::of_atmosphere(at, a.inner_radius, offset)
    })
}

/// The tangent frame under a view.
fn space_below(
    view: &ExtractedView,
    atmosphere: Option<&ExtractedAtmosphere>,
    settings: &CloudSettings,
) -> Option<TangentFrame> {
    let offset = settings.model.world_offset;
    let Planet { centre, radius } = planet(atmosphere, offset);
    let camera = view.world_from_view.translation().as_dvec3() + offset;
    TangentFrame::below(camera, centre, radius)
}

fn window_state(
    item: &PreparedViewItem,
    clouds: &ExtractedClouds,
    versions: Versions,
    space: &TangentFrame,
    sun: Sun,
) -> (HistoryKey, Pose) {
    let quality = &item.cloud.quality;
    let (view, viewport) = (item.view, item.drawn_viewport());
    let model = &clouds.settings.model;
    let altitude = space.altitude as f32;
    let layers = || clouds.settings.layers.shown().map(|(_, layer)| layer);
    // To the nearest deck.
    let to_shell = decks(model, layers())
        .into_iter()
        .map(|deck| (deck.x - altitude).max(altitude - deck.y))
        .fold(f32::INFINITY, f32::min)
        .clamp(300.0, 1e7);
    let key = HistoryKey {
        size: marched_size(viewport, quality),
        viewport,
        window: quality.held_frames(),
        reset: item.cloud.reset,
        versions,
        quality: quality.clone(),
        debug: item.cloud.debug,
        atmosphere: item.atmosphere.is_some(),
        msaa: item.msaa.samples(),
    };
    let pose = Pose {
        clip_from_view: view.clip_from_view,
        position: view.world_from_view.translation().as_dvec3() + model.world_offset,
        rotation: view.world_from_view.rotation(),
        world_from_local: space.local_from_world.inverse().as_quat(),
        sun,
        exposure: item.camera.exposure,
        seconds: clouds.settings.clock.seconds,
        winds: Winds::new(model, layers(), altitude).over_ground(space.shrink()),
        outlines: clouds.outline_speed,
        to_shell,
        texel: texel_angle(view.clip_from_view, viewport, quality),
    };
    (key, pose)
}
