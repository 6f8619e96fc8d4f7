//! Layers' maps from files of each kind, hot-reloaded, and by channel.

use bevy::prelude::*;
use bevy_cumulus::{prelude::*, settings::MapChannels};
use image::{ImageFormat, Rgba32FImage, RgbaImage};

use crate::support::{
    app::{clouds_app_in, is_baked},
    density::{ask, at},
    gpu::{run_until, run_updates, times_logged},
    program::Folder,
};
use crate::{
    model::layers::show,
    weather::convert::{encoded, ktx2},
};

fn app(folder: &Folder) -> App {
    let mut app = clouds_app_in(folder);
    run_until(&mut app, "the textures are baked", 600, |app| is_baked(app));
    app
}

/// A PNG all of one texel.
fn png(texel: [u8; 4]) -> Vec<u8> {
    encoded(RgbaImage::from_pixel(4, 4, image::Rgba(texel)), ImageFormat::Png)
}

/// A layer whose density half way up is its map's coverage: without noise, and of full height.
fn bare(file: &str, base: f32) -> CloudLayer {
    CloudLayer {
        map_file: file.to_owned(),
        base,
        base_rise: 0.0,
        thickness: 1000.0,
        peak_height: 0.5,
        shape_gain: 1.0,
        shape_strength: 0.0,
        detail_strength: 0.0,
        turbulence: 0.0,
        ..default()
    }
}

/// The density half way up a layer, which must be the same at all of some places.
fn density(app: &mut App, model: &CloudModel, layer: &CloudLayer) -> f32 {
    let height = layer.base + 0.5 * layer.thickness;
    let places = [Vec2::ZERO, Vec2::new(3000.0, -500.0), Vec2::new(-1234.0, 4321.0)];
    let answers = ask(app, model, &places.map(|m| at(Vec3::new(m.x, height, m.y), 0.0)));
    let found = answers[0][1];
    // Signal and filter: the curve lowers places by a metre of the 500 to the parabola's end, and texels are bytes.
    assert!(answers.iter().all(|answer| (answer[1] - found).abs() < 0.003), "{answers:?}");
    found
}

/// Half a step of a byte where a texel is rounded, another in the filter.
const BYTE: f32 = 1.0 / 255.0;

fn assert_is(found: f32, byte: u8, what: &str) {
    let expected = f32::from(byte) / 255.0;
    assert!((found - expected).abs() < 1.5 * BYTE, "{what}: {found}, not {expected}");
}

#[test]
fn maps_come_from_png_ktx2_and_exr() {
    let folder = Folder::new();
    let texel = |coverage: u8| [coverage, 255, 0, 255];
    folder.write("a.png", png(texel(51)));
    folder.write("b.ktx2", ktx2([texel(102); 2].as_flattened().try_into().expect("two texels")));
    let real = texel(153).map(|byte| f32::from(byte) / 255.0);
    folder.write("c.exr", encoded(Rgba32FImage::from_pixel(4, 4, image::Rgba(real)), ImageFormat::OpenExr));
    let mut app = app(&folder);
    let unsuited = "does not match AssetLoader settings type";
    let logged = times_logged(unsuited);
    let mut files = vec![("a.png", 51), ("b.ktx2", 102)];
    if cfg!(feature = "exr") {
        files.push(("c.exr", 153));
    }
    for (file, byte) in files {
        let layer = bare(file, 1000.0);
        let model = show(&mut app, std::slice::from_ref(&layer));
        assert_is(density(&mut app, &model, &layer), byte, file);
    }
    assert_eq!(times_logged(unsuited), logged, "a loader is given settings that are not its own");
}

#[test]
fn a_map_that_changes_is_taken_at_once() {
    let folder = Folder::new();
    folder.write("map.png", png([51, 255, 0, 255]));
    let mut app = app(&folder);
    let layer = bare("map.png", 1000.0);
    let model = show(&mut app, std::slice::from_ref(&layer));
    assert_is(density(&mut app, &model, &layer), 51, "as it was");
    // What a file watcher does.
    folder.write("map.png", png([204, 255, 0, 255]));
    let server = app.world().resource::<AssetServer>().clone();
    server.reload("map.png");
    let image = server.get_handle::<Image>("map.png").expect("it is loaded");
    let first = |app: &App| app.world().resource::<Assets<Image>>().get(&image).and_then(|i| Some(i.data.as_ref()?[0]));
    run_until(&mut app, "the file is loaded again", 300, |app| first(app) == Some(204));
    run_updates(&mut app, 3);
    assert_is(density(&mut app, &model, &layer), 204, "the file has changed");
    // What a game that paints does.
    let painted = WeatherMap::clear(UVec2::splat(8)).to_image();
    app.world_mut().resource_mut::<Assets<Image>>().insert(image.id(), painted).expect("the asset is there");
    run_updates(&mut app, 3);
    assert_is(density(&mut app, &model, &layer), 0, "the asset was painted over");
}

#[test]
fn four_layers_on_four_channels_of_one_image_are_four_skies() {
    let folder = Folder::new();
    let texel = [26, 77, 128, 204];
    folder.write("four.png", png(texel));
    let mut app = app(&folder);
    let channels = [MapChannels::Red, MapChannels::Green, MapChannels::Blue, MapChannels::Alpha];
    let layers: Vec<CloudLayer> = (0..4_u8)
        .map(|k| CloudLayer {
            map_channels: channels[usize::from(k)],
            ..bare("four.png", 1000.0 + 2000.0 * f32::from(k))
        })
        .collect();
    let model = show(&mut app, &layers);
    for (layer, byte) in layers.iter().zip(texel) {
        assert_is(density(&mut app, &model, layer), byte, &format!("{:?}", layer.map_channels));
    }
}
