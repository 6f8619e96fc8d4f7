//! The fields of settings, by reflection.

use bevy::{
    math::DVec3,
    prelude::*,
    reflect::{NamedField, TypeInfo, structs::StructInfo},
};

/// What is declared of a struct.
pub fn struct_info(info: &'static TypeInfo) -> &'static StructInfo {
    match info {
        TypeInfo::Struct(info) => info,
        other => panic!("{} is not a struct", other.type_path()),
    }
}

/// Every field below `root` with its path; of a struct within, its fields and not itself.
pub fn declared_in(root: &str, info: &'static TypeInfo) -> Vec<(String, &'static NamedField)> {
    let of = |field: &'static NamedField| {
        let path = format!("{root}.{}", field.name());
        let vector = field.is::<Vec3>() || field.is::<DVec3>();
        match field.type_info() {
            Some(inner @ TypeInfo::Struct(_)) if !vector => declared_in(&path, inner),
            _ => vec![(path, field)],
        }
    };
    struct_info(info).iter().flat_map(of).collect()
}
