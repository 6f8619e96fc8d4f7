//! Clouds among transparent things: one item of Bevy's transparent phase, put where it belongs.
//!
//! Bevy draws its sky after opaque and before transparent things by a system that cannot be named, so the first place
//! that is surely after the sky is within the transparent pass.

use bevy::{
    core_pipeline::core_3d::{Transparent3d, TransparentSortingInfo3d},
    ecs::{
        query::ROQueryItem,
        system::{SystemParamItem, lifetimeless::Read, lifetimeless::SRes},
    },
    math::DVec3,
    pbr::ExtractedAtmosphere,
    prelude::*,
    render::{
        render_phase::{
            DrawFunctions, PhaseItemExtraIndex, RenderCommand, RenderCommandResult, TrackedRenderPass,
            ViewSortedRenderPhases,
        },
        render_resource::{CachedRenderPipelineId, PipelineCache},
        sync_world::MainEntity,
        view::ExtractedView,
    },
};

use super::{
    bind_groups::CloudBindGroups,
    view::{ExtractedCloudView, ExtractedClouds, planet},
};
use crate::{
    model::decks,
    reference::planet::Planet,
    settings::{CloudOrder, CloudSettings},
};

/// Draws the view's clouds, once they can be.
pub(crate) struct DrawClouds;

impl RenderCommand<Transparent3d> for DrawClouds {
    type Param = SRes<PipelineCache>;
    type ViewQuery = Option<Read<CloudBindGroups>>;
    type ItemQuery = ();

    fn render<'w>(
        _: &Transparent3d,
        groups: ROQueryItem<'w, '_, Self::ViewQuery>,
        _: Option<()>,
        cache: SystemParamItem<'w, '_, Self::Param>,
        pass: &mut TrackedRenderPass<'w>,
    ) -> RenderCommandResult {
        let Some(groups) = groups else { return RenderCommandResult::Skip };
        let (id, own) = &groups.draw;
        let Some(pipeline) = cache.into_inner().get_render_pipeline(*id) else { return RenderCommandResult::Skip };
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &groups.empty, &[]);
        pass.set_bind_group(1, &groups.empty, &[]);
        pass.set_bind_group(2, own, &[]);
        pass.draw(0..3, 0..1);
        RenderCommandResult::Success
    }
}

/// The layer of clouds, and which side of it something is on.
struct Layer {
    /// Planet's centre less the world's offset, and radius (m).
    centre: DVec3,
    radius: f64,
    bottom: f64,
    top: f64,
}

impl Layer {
    /// The lowest deck: things above it are seen through it, and through thin cloud higher up as well.
    fn new(settings: &CloudSettings, atmosphere: Option<&ExtractedAtmosphere>) -> Self {
        let offset = settings.model.world_offset;
        let Planet { centre, radius } = planet(atmosphere, offset);
        let decks = decks(&settings.model, settings.layers.shown().map(|(_, layer)| layer));
        let [bottom, top] = decks.first().copied().unwrap_or_default().to_array().map(f64::from);
        Self { centre: centre - offset, radius, bottom, top }
    }

    fn altitude(&self, place: Vec3) -> f64 {
        (place.as_dvec3() - self.centre).length() - self.radius
    }

    /// Whether the layer's far side lies between a camera and a thing at these altitudes (m).
    fn is_beyond(&self, camera: f64, thing: f64) -> bool {
        (thing > self.top && camera < self.top) || (thing < self.bottom && camera > self.bottom)
    }
}

/// Puts the clouds of each view into its transparent phase, which is sorted from far to near.
pub(crate) fn sort_in(
    views: Query<(Entity, &MainEntity, &ExtractedView, &ExtractedCloudView, Option<&ExtractedAtmosphere>)>,
    clouds: Res<ExtractedClouds>,
    functions: Res<DrawFunctions<Transparent3d>>,
    mut phases: ResMut<ViewSortedRenderPhases<Transparent3d>>,
) {
    let Some(draw_function) = functions.read().get_id::<DrawClouds>() else { return };
    for (entity, main_entity, view, cloud, atmosphere) in &views {
        if cloud.order == CloudOrder::AfterTransparent {
            continue;
        }
        let Some(phase) = phases.get_mut(&view.retained_view_entity) else { continue };
        let item = (entity, *main_entity);
        phase.add_transient(Transparent3d {
            sorting_info: TransparentSortingInfo3d::AlwaysOnTop,
            distance: 0.0,
            // The item itself knows which.
            pipeline: CachedRenderPipelineId::INVALID,
            entity: item,
            draw_function,
            batch_range: 0..1,
            extra_index: PhaseItemExtraIndex::None,
            indexed: false,
        });
        let layer = Layer::new(&clouds.settings, atmosphere);
        let camera = layer.altitude(view.world_from_view.translation());
        let is_beyond = |info: &TransparentSortingInfo3d| match info {
            TransparentSortingInfo3d::Sorted { mesh_center, .. } if cloud.order == CloudOrder::Sorted => {
                layer.is_beyond(camera, layer.altitude(*mesh_center))
            }
            _ => false,
        };
        // Stable: among themselves all stay as they are. Along a ray nothing beyond the layer is nearer than what is
        // not, so nothing is torn out of its order that overlaps.
        phase
            .items
            .sort_by_key(|key, thing| if *key == item { 1 } else { 2 * u8::from(!is_beyond(&thing.sorting_info)) });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        reference::planet::PLANET_RADIUS,
        settings::{CloudLayer, CloudLayers, CloudModel},
    };

    #[test]
    fn things_are_sorted_by_the_side_of_the_layer() {
        let model = CloudModel { bottom: 1500.0, top: 4000.0, ..default() };
        // What lies higher than the lowest deck does not sort.
        let layers = CloudLayers(vec![CloudLayer { base: 8000.0, ..default() }]);
        let layer = Layer::new(&CloudSettings { model, layers, ..default() }, None);
        for (camera, thing, beyond) in [
            (10.0, 0.0, false),
            (10.0, 2000.0, false),
            (10.0, 9000.0, true),
            (2000.0, 1800.0, false),
            (2000.0, 5000.0, true),
            (2000.0, 0.0, true),
            (8000.0, 6000.0, false),
            (8000.0, 2000.0, false),
            (8000.0, 0.0, true),
        ] {
            assert_eq!(layer.is_beyond(camera, thing), beyond, "{thing} m seen from {camera} m");
        }
    }

    #[test]
    fn altitude_follows_the_curve_and_the_offset() {
        let far = Vec3::new(1e6, 0.0, 0.0);
        let layer = Layer::new(&CloudSettings::default(), None);
        let exact = PLANET_RADIUS.hypot(1e6) - PLANET_RADIUS;
        assert!((layer.altitude(far) - exact).abs() < 1e-3);
        let model = CloudModel { world_offset: far.as_dvec3(), ..default() };
        let shifted = Layer::new(&CloudSettings { model, ..default() }, None);
        assert!((shifted.altitude(Vec3::ZERO) - exact).abs() < 1e-3);
    }
}
