//! Scenes: all settings at once, and where they are looked at from.

use std::collections::HashMap;

use bevy::{
    asset::RenderAssetUsages,
    prelude::*,
    reflect::GetPath,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};
use bevy_cumulus::{prelude::*, settings::snake_case};

/// Colour of every texel of an image.
pub type Colour = [u8; 4];

/// Settings of an app, and what else a row may change.
#[derive(Clone, Default)]
pub struct Scene {
    pub settings: CloudSettings,
    /// Images in place of baked textures, by slot.
    pub slots: Vec<(&'static str, Colour)>,
    /// The first layer's image in place of its map.
    pub map_image: Option<Colour>,
    /// At the world's origin.
    pub zone: Option<CloudZone>,
    pub view: CloudView,
    /// Where the camera stands, and where it looks.
    pub pose: Transform,
    /// Points of the field lie as far as this from the origin, along x and z (m).
    pub wide: f32,
    /// Altitudes that they lie between (m).
    pub heights: [f32; 2],
}

impl Scene {
    /// Sets the setting at this path from text, as [`CloudSettings::set`] does; and what stands outside of its reach.
    pub fn set(&mut self, path: &'static str, text: &str) {
        let (root, name) = path.split_once('.').expect("a path has two parts");
        match root {
            "slots" => {
                self.slots.retain(|(slot, _)| *slot != name);
                self.slots.extend(colour(text).map(|colour| (name, colour)));
            }
            "zone" => {
                let zone = self.zone.get_or_insert_default();
                *zone.path_mut::<f32>(name).expect(path) = text.parse().expect("a number");
            }
            "view" => self.set_view(name, text),
            _ if name.ends_with("map_image") => self.map_image = colour(text),
            _ => self.settings.set(path, text).unwrap_or_else(|error| panic!("{error}")),
        }
    }

    fn set_view(&mut self, name: &str, text: &str) {
        match name {
            "enabled" => self.view.enabled = text == "true",
            "reset" => self.view.reset = text.parse().expect("a number"),
            "debug" => self.view.debug = CloudDebugView::named(text).expect("a debug view"),
            "order" => {
                let all = [CloudOrder::Sorted, CloudOrder::BeforeTransparent, CloudOrder::AfterTransparent];
                let is_named = |order: &CloudOrder| snake_case(&format!("{order:?}")) == text;
                self.view.order = all.into_iter().find(is_named).expect("an order");
            }
            // One of its own: the resource's, but for a cut-off so near that nothing is seen.
            "quality" => {
                let near = CloudQuality { max_distance: 200.0, ..self.settings.quality.clone() };
                self.view.quality = (text == "near").then_some(near);
            }
            _ => panic!("a view has no {name}"),
        }
    }

    /// Puts the settings into an app, only those that differ from what is there.
    pub fn apply(&self, app: &mut App, images: &mut Images) {
        let mut settings = self.settings.clone();
        if let (Some(colour), Some(layer)) = (self.map_image, settings.layers.0.first_mut()) {
            layer.map_image = Some(images.get(app, colour, false));
        }
        let mut slots = CloudTextureSlots::default();
        for (slot, colour) in &self.slots {
            let is_volume = ["billow", "wisp", "shape", "detail"].contains(slot);
            let image = images.get(app, *colour, is_volume);
            *slots.path_mut::<Option<Handle<Image>>>(*slot).expect(slot) = Some(image);
        }
        let world = app.world_mut();
        put(world, settings.model);
        put(world, settings.layers);
        put(world, settings.lighting);
        put(world, settings.quality);
        put(world, settings.textures);
        put(world, settings.clock);
        put(world, slots);
        let zones: Vec<Entity> = world.query_filtered::<Entity, With<CloudZone>>().iter(world).collect();
        zones.into_iter().for_each(|zone| _ = world.despawn(zone));
        if let Some(zone) = self.zone {
            world.spawn(zone);
        }
    }
}

fn put<R: Resource + PartialEq>(world: &mut World, value: R) {
    if world.get_resource::<R>() != Some(&value) {
        world.insert_resource(value);
    }
}

fn colour(text: &str) -> Option<Colour> {
    match text {
        "none" => None,
        "black" => Some([0, 0, 0, 255]),
        "white" => Some([255; 4]),
        "green" => Some([0, 255, 0, 255]),
        _ => panic!("{text} is no colour"),
    }
}

/// Images of one colour, each made once.
#[derive(Default)]
pub struct Images(HashMap<(Colour, bool), Handle<Image>>);

impl Images {
    fn get(&mut self, app: &mut App, colour: Colour, is_volume: bool) -> Handle<Image> {
        let made = || {
            let depth = if is_volume { 8 } else { 1 };
            let dimension = if is_volume { TextureDimension::D3 } else { TextureDimension::D2 };
            let size = Extent3d { width: 8, height: 8, depth_or_array_layers: depth };
            let image = Image::new_fill(size, dimension, &colour, TextureFormat::Rgba8Unorm, RenderAssetUsages::all());
            app.world_mut().resource_mut::<Assets<Image>>().add(image)
        };
        self.0.entry((colour, is_volume)).or_insert_with(made).clone()
    }
}
