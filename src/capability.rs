//! What a device must be able to do.

use bevy::{
    prelude::*,
    render::{
        render_resource::{DownlevelFlags, TextureFormat, TextureUsages},
        renderer::{RenderAdapter, RenderDevice},
        settings::WgpuLimits,
    },
};

/// Formats that are written by compute.
const STORED: [TextureFormat; 4] =
    [TextureFormat::Rgba8Unorm, TextureFormat::Rgba16Float, TextureFormat::Rgba32Float, TextureFormat::R32Uint];

/// What the render world's device lacks, with the adapter's name; `None` where it lacks nothing.
pub(crate) fn missing_capability(world: &World) -> Option<String> {
    let adapter = world.get_resource::<RenderAdapter>()?;
    let device = world.get_resource::<RenderDevice>()?;
    let flags = adapter.get_downlevel_capabilities().flags;
    let can_store =
        |format| adapter.get_texture_format_features(format).allowed_usages.contains(TextureUsages::STORAGE_BINDING);
    let lacks = missing(flags, &device.limits(), can_store)?;
    Some(format!("{}: {lacks}", adapter.get_info().name))
}

/// What a device with these flags and limits, which can store to textures of some formats, lacks.
fn missing(flags: DownlevelFlags, limits: &WgpuLimits, can_store: impl Fn(TextureFormat) -> bool) -> Option<String> {
    if !flags.contains(DownlevelFlags::COMPUTE_SHADERS) {
        return Some("it has no compute shaders".to_owned());
    }
    for (what, has, needs) in [
        ("max_storage_textures_per_shader_stage", limits.max_storage_textures_per_shader_stage, 3),
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, 2),
        ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, 128),
        ("max_bind_groups", limits.max_bind_groups, 3),
    ] {
        if has < needs {
            return Some(format!("{what} is {has}, and clouds need {needs}"));
        }
    }
    let format = STORED.into_iter().find(|format| !can_store(*format))?;
    Some(format!("{format:?} cannot be a storage texture"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: DownlevelFlags = DownlevelFlags::all();

    #[test]
    fn what_webgpu_promises_is_enough() {
        assert_eq!(missing(ALL, &WgpuLimits::default(), |_| true), None);
    }

    #[test]
    fn a_device_without_compute_is_told_so() {
        // OpenGL ES 3.0, as WebGL 2 has it: neither flag nor limits.
        let limits = WgpuLimits::downlevel_webgl2_defaults();
        let said = missing(ALL - DownlevelFlags::COMPUTE_SHADERS, &limits, |_| false);
        assert_eq!(said.as_deref(), Some("it has no compute shaders"));
        // A flag without what it takes.
        assert!(missing(ALL, &limits, |_| true).is_some());
    }

    #[test]
    fn each_limit_is_named_where_it_is_one_short() {
        type Limit = fn(&mut WgpuLimits) -> &mut u32;
        let cases: [(&str, u32, Limit); 4] = [
            ("max_storage_textures_per_shader_stage", 3, |l| &mut l.max_storage_textures_per_shader_stage),
            ("max_storage_buffers_per_shader_stage", 2, |l| &mut l.max_storage_buffers_per_shader_stage),
            ("max_compute_invocations_per_workgroup", 128, |l| &mut l.max_compute_invocations_per_workgroup),
            ("max_bind_groups", 3, |l| &mut l.max_bind_groups),
        ];
        for (name, needs, limit) in cases {
            let mut limits = WgpuLimits::default();
            *limit(&mut limits) = needs;
            assert_eq!(missing(ALL, &limits, |_| true), None, "{name} of {needs} is enough");
            *limit(&mut limits) = needs - 1;
            let said = format!("{name} is {}, and clouds need {needs}", needs - 1);
            assert_eq!(missing(ALL, &limits, |_| true), Some(said));
        }
    }

    #[test]
    fn each_format_is_named_where_it_cannot_be_stored_to() {
        for format in STORED {
            let said = missing(ALL, &WgpuLimits::default(), |other| other != format);
            assert_eq!(said, Some(format!("{format:?} cannot be a storage texture")));
        }
        // Others are not asked for.
        assert_eq!(missing(ALL, &WgpuLimits::default(), |format| STORED.contains(&format)), None);
    }
}
