//! Layers' weather maps: made in the background, kept while they are wanted, uploaded as one texture array.

use std::sync::Arc;

use bevy::{
    asset::{AssetId, AssetPath, LoadState},
    image::ImageLoaderSettings,
    prelude::*,
    render::{
        Extract,
        render_resource::{
            Extent3d, TextureDataOrder, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
            TextureViewDescriptor, TextureViewDimension,
        },
        renderer::{RenderDevice, RenderQueue},
    },
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};

use super::bake::CloudTextureViews;
use crate::{
    settings::{CloudLayer, CloudWeather, GoodSettings, MAX_LAYERS, MapChannels},
    weather::{Swirl, WeatherMap, WeatherPyramid, WeatherRecipe},
};

/// Longest side of the array (texels); larger images are brought to it.
const LARGEST: u32 = 2048;

/// What a map is made from: equal sources make equal maps.
#[derive(Clone, PartialEq, Debug)]
enum Source {
    Recipe(WeatherRecipe),
    Image {
        image: AssetId<Image>,
        revision: u32,
        channels: MapChannels,
    },
    /// The file's path is none.
    NoPath {
        reason: String,
    },
}

/// Texels of each level, finest first.
type Levels = Vec<Vec<[u8; 4]>>;

/// A map being made, or made.
struct Entry {
    source: Source,
    task: Option<Task<WeatherMap>>,
    map: Option<Arc<WeatherMap>>,
}

/// What a layer shows.
struct Shown {
    name: String,
    asked: Source,
    /// The map that it asks for, or its last good one until that is made.
    map: Option<(Source, Arc<WeatherMap>)>,
}

/// The maps of all layers, by their place in [`CloudLayers`](crate::settings::CloudLayers).
#[derive(Resource, Default)]
pub(crate) struct LayerMaps {
    entries: Vec<Entry>,
    files: Vec<(String, Handle<Image>)>,
    /// Counts changes of images.
    revisions: bevy::platform::collections::HashMap<AssetId<Image>, u32>,
    /// What is wrong with an image, told once.
    told: Vec<Source>,
    /// What each layer shows, as the list has them.
    shown: Vec<Shown>,
    /// Their pyramids, all of one size.
    published: WeatherMaps,
}

/// Pyramids of the layers' maps, and a count of their changes.
#[derive(Resource, Clone, Default)]
pub(crate) struct WeatherMaps {
    pub maps: [Option<Arc<WeatherPyramid>>; MAX_LAYERS],
    version: u32,
    /// Whether a map is still to come.
    pub(crate) pending: bool,
}

impl LayerMaps {
    /// Pyramids as they are shown, for the CPU's copy of the model.
    pub(crate) fn published(&self) -> &WeatherMaps {
        &self.published
    }

    fn source(&mut self, layer: &CloudLayer, assets: Option<&AssetServer>) -> Source {
        let channels = layer.map_channels;
        let mut image = |id| Source::Image { image: id, revision: *self.revisions.entry(id).or_default(), channels };
        if let Some(handle) = &layer.map_image {
            return image(handle.id());
        }
        let Some(assets) = assets.filter(|_| !layer.map_file.is_empty()) else {
            return Source::Recipe(layer.map.clone());
        };
        let id = match self.files.iter().find(|(path, _)| *path == layer.map_file) {
            Some((_, handle)) => handle.id(),
            None => {
                let handle = match asset_path(&layer.map_file) {
                    Ok(path) => load_linear(assets, path),
                    Err(reason) => return Source::NoPath { reason },
                };
                self.files.push((layer.map_file.clone(), handle.clone()));
                handle.id()
            }
        };
        Source::Image { image: id, revision: *self.revisions.entry(id).or_default(), channels }
    }

    /// The map of a source once it is made; begins to make it.
    fn find(&mut self, source: &Source, images: &Images) -> Result<Option<Arc<WeatherMap>>, String> {
        if let Some(entry) = self.entries.iter_mut().find(|entry| entry.source == *source) {
            if let Some(made) = entry.task.as_mut().and_then(|task| block_on(poll_once(task))) {
                entry.task = None;
                entry.map = Some(Arc::new(made));
            }
            return Ok(entry.map.clone());
        }
        let mut entry = Entry { source: source.clone(), task: None, map: None };
        match source {
            Source::Recipe(recipe) => {
                let recipe = recipe.clone();
                // The settings have been validated; a clear map stands for what cannot be.
                let make = async move { recipe.generate().unwrap_or_else(|_| WeatherMap::clear(UVec2::ONE)) };
                entry.task = Some(AsyncComputeTaskPool::get().spawn(make));
            }
            Source::Image { image, channels, .. } => match images.get(*image, *channels)? {
                None => return Ok(None),
                Some(map) => entry.map = Some(Arc::new(map)),
            },
            Source::NoPath { reason } => return Err(format!("map_file: {reason}")),
        }
        self.entries.push(entry);
        Ok(self.entries.last().and_then(|entry| entry.map.clone()))
    }
}

/// Images as maps, and why there is none.
struct Images<'a> {
    loaded: &'a Assets<Image>,
    server: Option<&'a AssetServer>,
}

impl Images<'_> {
    /// The map in an image; `None` while it loads.
    fn get(&self, image: AssetId<Image>, channels: MapChannels) -> Result<Option<WeatherMap>, String> {
        if let Some(image) = self.loaded.get(image) {
            let map = WeatherMap::from_image_channels(image, channels);
            return map.map(Some).map_err(|error| format!("map: {error}"));
        }
        match self.server.and_then(|server| server.get_load_state(image)) {
            Some(LoadState::Failed(error)) => Err(format!("map_file did not load: {error}")),
            _ => Ok(None),
        }
    }
}

/// Loads an image whose bytes are numbers, not colours.
fn load_linear(assets: &AssetServer, path: AssetPath<'static>) -> Handle<Image> {
    // Loaders of floats have no such setting, and it would be an error to them.
    let floats = ["exr", "hdr"];
    if path.path().extension().is_some_and(|end| floats.iter().any(|float| end.eq_ignore_ascii_case(float))) {
        return assets.load(path);
    }
    assets.load_builder().with_settings(|settings: &mut ImageLoaderSettings| settings.is_srgb = false).load(path)
}

/// The path, if the asset server would load it.
pub(crate) fn asset_path(text: &str) -> Result<AssetPath<'static>, String> {
    let text = text.trim();
    let path = AssetPath::try_parse(text).map_err(|error| format!("{text:?} is not an asset path: {error}"))?;
    if text.is_empty() {
        Err("give the path of an image".to_owned())
    } else if path.is_unapproved() {
        Err(format!("{text} lies outside the assets folder, from which the app loads nothing"))
    } else {
        Ok(path.into_owned())
    }
}

/// Follows the layers: makes what they ask for, forgets what nobody does.
pub(crate) fn follow_layers(
    good: Res<GoodSettings>,
    weather: Option<Res<CloudWeather>>,
    assets: Option<Res<AssetServer>>,
    images: Res<Assets<Image>>,
    mut changes: MessageReader<AssetEvent<Image>>,
    mut maps: ResMut<LayerMaps>,
) {
    for change in changes.read() {
        if let AssetEvent::Modified { id } = change
            && let Some(revision) = maps.revisions.get_mut(id)
        {
            *revision += 1;
        }
    }
    let is_ahead = weather.as_ref().is_some_and(|weather| weather.layers_ahead(good.0.clock.seconds).next().is_some());
    if good.0.layers.0.is_empty() && maps.entries.is_empty() && maps.shown.is_empty() && !is_ahead {
        maps.published.pending = false;
        return;
    }
    let images = Images { loaded: &images, server: assets.as_deref() };
    let in_transition = weather.as_ref().is_some_and(|weather| weather.has_moved());
    let layers = &good.0.layers.0[..good.0.layers.0.len().min(MAX_LAYERS)];
    let mut wanted: Vec<Source> = layers.iter().map(|layer| maps.source(layer, images.server)).collect();
    maps.align(layers, &wanted);
    let mut pending = false;
    for (i, (layer, source)) in layers.iter().zip(&wanted).enumerate() {
        // The map of one that is hidden is kept: it may be shown again.
        if layer.enabled {
            pending |= maps.show(i, source, &images, in_transition);
        }
    }
    for layer in weather.iter().flat_map(|weather| weather.layers_ahead(good.0.clock.seconds)) {
        let source = maps.source(layer, assets.as_deref());
        if !wanted.contains(&source) {
            // What is wrong with it is told when its layer is shown.
            let _ = maps.find(&source, &images);
            wanted.push(source);
        }
    }
    maps.published.pending = pending;
    maps.told.retain(|source| wanted.contains(source));
    maps.entries.retain(|entry| wanted.contains(&entry.source));
    let reads = |source: &Source, of: AssetId<Image>| matches!(source, Source::Image { image, .. } if *image == of);
    maps.files.retain(|(_, handle)| wanted.iter().any(|source| reads(source, handle.id())));
    maps.publish();
}

impl LayerMaps {
    /// Brings what is shown in line with a list that has changed: layers are known by what they ask for, or else by place
    /// and name. One that is new shows nothing yet.
    fn align(&mut self, layers: &[CloudLayer], sources: &[Source]) {
        let same = |(shown, (layer, source)): (&Shown, (&CloudLayer, &Source))| {
            shown.name == layer.name && shown.asked == *source
        };
        let asked = || layers.iter().zip(sources);
        if self.shown.len() == layers.len() && self.shown.iter().zip(asked()).all(same) {
            return;
        }
        let old = std::mem::take(&mut self.shown);
        let in_place = |i: usize, name: &str| old.get(i).filter(|was| old.len() == layers.len() && was.name == name);
        let all = asked().enumerate().map(|(i, (layer, source))| {
            let was = old.iter().find(|was| was.asked == *source).or_else(|| in_place(i, &layer.name));
            Shown { name: layer.name.clone(), asked: source.clone(), map: was.and_then(|was| was.map.clone()) }
        });
        self.shown = all.collect();
    }

    /// Shows a layer's map, or what it showed last. Returns whether the map is still to come.
    fn show(&mut self, i: usize, source: &Source, images: &Images, in_transition: bool) -> bool {
        let found = self.find(source, images);
        let Some(shown) = self.shown.get_mut(i) else { return false };
        let is_asked = |(now, _): &(Source, Arc<WeatherMap>)| now == source;
        match found {
            Ok(Some(map)) => {
                if !shown.map.as_ref().is_some_and(is_asked) {
                    shown.map = Some((source.clone(), map));
                }
            }
            Ok(None) => {
                // A layer that forms must not show with another's map and then with its own.
                if in_transition && !shown.map.as_ref().is_some_and(is_asked) {
                    shown.map = None;
                }
                return true;
            }
            Err(reason) => {
                if !self.told.contains(source) {
                    error!("clouds: layers.{i}.{reason}; the last good map stays");
                    self.told.push(source.clone());
                }
            }
        }
        false
    }

    /// Hands on what is shown, if it is not what was.
    fn publish(&mut self) {
        let map = |i: usize| self.shown.get(i).and_then(|shown| Some(&shown.map.as_ref()?.1));
        let is_same = |i: usize| match (map(i), &self.published.maps[i]) {
            (Some(map), Some(published)) => Arc::ptr_eq(map, &published.map),
            (map, published) => map.is_none() && published.is_none(),
        };
        if (0..MAX_LAYERS).all(is_same) {
            return;
        }
        let sizes =
            (0..MAX_LAYERS).filter_map(map).map(|map| map.size().max_element().next_power_of_two().min(LARGEST));
        let size = sizes.max().unwrap_or(1);
        let old = &self.published.maps;
        let maps = std::array::from_fn(|i| {
            map(i).map(|map| {
                // One that has not changed is not built again.
                let same = |p: &&Arc<WeatherPyramid>| p.size == size && Arc::ptr_eq(&p.map, map);
                old.iter().flatten().find(same).cloned().unwrap_or_else(|| Arc::new(WeatherPyramid::new(map, size)))
            })
        });
        self.published.maps = maps;
        self.published.version += 1;
    }
}

/// The render world's copy.
#[derive(Resource, Default)]
pub(super) struct Uploaded(Option<u32>);

pub(super) fn extract(maps: Extract<Res<LayerMaps>>, mut out: ResMut<WeatherMaps>) {
    if out.version != maps.published.version {
        *out = maps.published.clone();
    }
    out.pending = maps.published.pending;
}

/// Uploads what has changed.
pub(super) fn upload(
    maps: Res<WeatherMaps>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut uploaded: ResMut<Uploaded>,
    mut views: ResMut<CloudTextureViews>,
) {
    if views.swirl.is_none() {
        let levels = Swirl::shared();
        views.swirl = Some(array(&device, &queue, "cloud_swirl", &[levels], TextureViewDimension::D2));
        uploaded.0 = None;
    }
    views.maps_pending = maps.pending;
    if uploaded.0 == Some(maps.version) {
        return;
    }
    uploaded.0 = Some(maps.version);
    let size = maps.maps.iter().flatten().map(|map| map.size).max().unwrap_or(1);
    let last = maps.maps.iter().rposition(Option::is_some).map_or(1, |i| i + 1);
    let blank: Levels = vec![vec![[0; 4]; (size * size) as usize]; size.ilog2() as usize + 1]
        .into_iter()
        .enumerate()
        .map(|(level, mut texels)| {
            texels.truncate(((size >> level) * (size >> level)) as usize);
            texels
        })
        .collect();
    let layers: Vec<&[Vec<[u8; 4]>]> =
        maps.maps[..last].iter().map(|map| map.as_ref().map_or(&*blank, |map| &map.levels)).collect();
    views.weather = Some(array(&device, &queue, "cloud_weather", &layers, TextureViewDimension::D2Array));
    views.weather_size = size;
    views.weather_layers = std::array::from_fn(|i| maps.maps[i].is_some());
    views.generation += 1;
}

fn array(
    device: &RenderDevice,
    queue: &RenderQueue,
    label: &'static str,
    layers: &[&[Vec<[u8; 4]>]],
    dimension: TextureViewDimension,
) -> bevy::render::render_resource::TextureView {
    let side = (layers[0][0].len() as f32).sqrt().round() as u32;
    let data: Vec<u8> = layers.iter().flat_map(|levels| levels.iter().flatten().flatten().copied()).collect();
    let texture = device.create_texture_with_data(
        queue,
        &TextureDescriptor {
            label: Some(label),
            size: Extent3d { width: side, height: side, depth_or_array_layers: layers.len() as u32 },
            mip_level_count: layers[0].len() as u32,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::Rgba8Unorm,
            usage: TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        TextureDataOrder::LayerMajor,
        &data,
    );
    texture.create_view(&TextureViewDescriptor { dimension: Some(dimension), ..default() })
}

#[cfg(test)]
#[path = "weather_maps_tests.rs"]
mod tests;
