//! The stages of a frame, as systems in `Core3d`.

use bevy::{
    camera::{MainPassResolutionOverride, Viewport},
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::*,
        renderer::{RenderContext, ViewQuery},
        texture::GpuImage,
        view::ViewTarget,
    },
};

use super::{
    bind_groups::{CloudBindGroups, Light},
    history::CloudHistory,
    view::ExtractedCloudView,
};
use crate::settings::CloudOrder;

/// Texels along one side of a workgroup.
const GROUP: u32 = 8;

/// Records one compute stage: groups 0 to 2, one dispatch, one GPU timing span.
fn dispatch(
    ctx: &mut RenderContext,
    label: &'static str,
    pipeline: Option<&ComputePipeline>,
    groups: [(&BindGroup, &[u32]); 3],
    size: UVec2,
) {
    let Some(pipeline) = pipeline else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass =
        ctx.command_encoder().begin_compute_pass(&ComputePassDescriptor { label: Some(label), timestamp_writes: None });
    let span = diagnostics.pass_span(&mut pass, label);
    pass.set_pipeline(pipeline);
    for (index, (group, offsets)) in (0..).zip(groups) {
        pass.set_bind_group(index, group, offsets);
    }
    pass.dispatch_workgroups(size.x, size.y, 1);
    span.end(&mut pass);
}

fn workgroups(size: UVec2) -> UVec2 {
    (size + GROUP - 1) / GROUP
}

/// Ambient light for the view.
pub(crate) fn cloud_sky(view: ViewQuery<&CloudBindGroups>, cache: Res<PipelineCache>, mut ctx: RenderContext) {
    let groups = view.into_inner();
    let (id, own) = &groups.sky;
    dispatch(
        &mut ctx,
        "cloud_sky",
        cache.get_compute_pipeline(*id),
        [(&groups.air, &groups.air_offsets), (&groups.model, &[]), (own, &[])],
        UVec2::ONE,
    );
}

/// One ray or one path a texel.
pub(crate) fn cloud_light(
    view: ViewQuery<(&CloudBindGroups, &CloudHistory)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (groups, history) = view.into_inner();
    let (label, (id, own)) = match &groups.light {
        Light::March { march, .. } => ("cloud_march", march),
        Light::PathTrace { trace, .. } => ("cloud_path_trace", trace),
    };
    dispatch(
        &mut ctx,
        label,
        cache.get_compute_pipeline(*id),
        [(&groups.air, &groups.air_offsets), (&groups.model, &[]), (own, &[])],
        workgroups(history.rays()),
    );
}

/// Adds the newest frame, takes away the oldest.
pub(crate) fn cloud_accumulate(
    view: ViewQuery<(&CloudBindGroups, &CloudHistory, &ExtractedCloudView)>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (groups, history, cloud) = view.into_inner();
    let empty = (&groups.empty, &[][..]);
    // The path tracer adds its frames up itself.
    let after_light = match &groups.light {
        Light::March { accumulate, .. } => Some(("cloud_accumulate", accumulate)),
        Light::PathTrace { noise, .. } => noise.as_ref().map(|noise| ("cloud_noise", noise)),
    };
    if let Some((label, (id, own))) = after_light {
        let groups = [empty, empty, (own, &[][..])];
        dispatch(&mut ctx, label, cache.get_compute_pipeline(*id), groups, workgroups(history.size()));
    }
    if let Some(image) = cloud.frame.and_then(|id| images.get(id)) {
        let room = history.size().min(UVec2::new(image.texture.width(), image.texture.height()));
        ctx.command_encoder().copy_texture_to_texture(
            history.newest_copy(),
            image.texture.as_image_copy(),
            Extent3d { width: room.x, height: room.y, depth_or_array_layers: 1 },
        );
    }
}

/// The picture at the view's size, and what the app asked for.
pub(crate) fn cloud_composite(
    view: ViewQuery<(&CloudBindGroups, &CloudHistory)>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (groups, history) = view.into_inner();
    let empty = (&groups.empty, &[][..]);
    let stages = [
        ("cloud_composite", Some(&groups.composite)),
        ("cloud_publish", groups.publish.as_ref()),
        ("cloud_depth", groups.depth.as_ref()),
    ];
    for (label, stage) in stages {
        let Some((id, own)) = stage else { continue };
        let size = workgroups(history.viewport_size());
        dispatch(&mut ctx, label, cache.get_compute_pipeline(*id), [empty, empty, (own, &[])], size);
    }
}

/// Draws the clouds over everything where that is the view's order: past TAA, since cloud has a history of its own and
/// TAA would reproject it as the sky it covers; but before, where the scene is to be enlarged there.
pub(crate) fn cloud_draw_over<const LATE: bool>(
    view: ViewQuery<(
        &CloudBindGroups,
        &ViewTarget,
        &ExtractedCamera,
        &ExtractedCloudView,
        Option<&MainPassResolutionOverride>,
    )>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (groups, target, camera, cloud, small) = view.into_inner();
    let (id, own) = &groups.draw;
    let Some(pipeline) = cache.get_render_pipeline(*id) else { return };
    if cloud.order != CloudOrder::AfterTransparent || LATE == small.is_some() {
        return;
    }
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("cloud_draw"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view: target.main_texture_view(),
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
        })],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "cloud_draw");
    if let Some(viewport) = Viewport::from_viewport_and_override(camera.viewport.as_ref(), small) {
        pass.set_camera_viewport(&viewport);
    }
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &groups.empty, &[]);
    pass.set_bind_group(1, &groups.empty, &[]);
    pass.set_bind_group(2, own, &[]);
    pass.draw(0..3, 0..1);
    span.end(&mut pass);
}
