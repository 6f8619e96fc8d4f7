//! The model for shaders that are not the renderer's.

use bevy::{
    math::DVec3,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{BindGroup, BindGroupLayoutDescriptor, PipelineCache, UniformBuffer},
        renderer::{RenderDevice, RenderQueue},
    },
};

use crate::{
    model::{MAX_ZONES, ModelBindings, ModelSettings, ModelUniform, TangentFrame, TexelSizes, ZoneAt, ZoneUniform},
    reference::planet::PLANET_RADIUS,
    settings::{CloudClock, CloudLayers, CloudModel, CloudZone, Validate},
    textures::CloudTextureViews,
};

/// Bind group 1 with its layout, for a compute shader that imports `bevy_cumulus::model::model`: the app's model at
/// its cloud time, in the tangent frame below `camera` (world space, m), on Bevy's default planet. It keeps what the
/// settings are now.
///
/// # Errors
/// Says what is missing or wrong.
pub fn model_bindings(app: &App, camera: DVec3) -> Result<(BindGroupLayoutDescriptor, BindGroup), String> {
    let model = app.world().get_resource::<CloudModel>().ok_or("no CloudModel")?;
    model.validate().map_err(|error| error.to_string())?;
    let clock = app.world().get_resource::<CloudClock>().ok_or("no CloudClock")?;
    let world = app.get_sub_app(RenderApp).ok_or("no render app")?.world();
    let views = world.get_resource::<CloudTextureViews>().ok_or("no textures on this device")?;
    if views.maps_pending {
        return Err("a layer's map is not there yet".to_owned());
    }
    let sizes = TexelSizes::of(views).ok_or("the textures are not there yet")?;
    let centre = DVec3::new(0.0, -PLANET_RADIUS, 0.0);
    let frame = TangentFrame::below(camera + model.world_offset, centre, PLANET_RADIUS)
        .ok_or("the camera is at the planet's centre, or not a number")?;
    let layers = app.world().get_resource::<CloudLayers>().ok_or("no CloudLayers")?;
    let position = camera + model.world_offset;
    let zones: Vec<ZoneUniform> =
        app.world().try_query::<(Entity, &CloudZone, &GlobalTransform)>().map_or_else(Vec::new, |mut zones| {
            let at = zones
                .iter(app.world())
                .filter_map(|(entity, zone, at)| ZoneAt::new(entity, zone, at.translation(), model.world_offset));
            at.map(|zone| zone.seen_from(position, &frame).1).take(MAX_ZONES).collect()
        });
    let settings = ModelSettings { model, layers, zones: &zones };
    let device = world.resource::<RenderDevice>();
    let mut uniform = UniformBuffer::from(ModelUniform::new(&settings, clock.seconds, &frame, sizes));
    uniform.write_buffer(device, world.resource::<RenderQueue>());
    let bindings = world.get_resource::<ModelBindings>().ok_or("clouds are off on this device")?;
    let group = bindings
        .bind_group(device, world.resource::<PipelineCache>(), &uniform, views)
        .ok_or("the textures are not there yet")?;
    Ok((bindings.layout.clone(), group))
}
