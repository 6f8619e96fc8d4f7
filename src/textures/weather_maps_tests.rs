//! Which map each layer shows while lists and maps change, without a renderer.

use bevy::{asset::RenderAssetUsages, prelude::*, render::render_resource::TextureFormat};

use super::*;
use crate::{CloudsPlugin, settings::CloudLayers};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), CloudsPlugin));
    app.finish();
    app.cleanup();
    app
}

/// A layer whose map is an image of this side, all of one coverage.
fn painted(app: &mut App, name: &str, side: u32, coverage: u8) -> CloudLayer {
    let size = Extent3d { width: side, height: side, depth_or_array_layers: 1 };
    let texel = [coverage, 255, 0, 255];
    let format = TextureFormat::Rgba8Unorm;
    let image = Image::new_fill(size, TextureDimension::D2, &texel, format, RenderAssetUsages::default());
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    CloudLayer { name: name.to_owned(), map_image: Some(image), ..default() }
}

/// A layer whose map takes a while to be made.
fn slow(seed: u32) -> CloudLayer {
    CloudLayer { map: WeatherRecipe { seed, size: 1024, ..default() }, ..default() }
}

/// Side of each layer's map, and the coverage of its first texel.
fn shown(app: &App) -> Vec<Option<(u32, u8)>> {
    let maps = &app.world().resource::<LayerMaps>().published().maps;
    let last = maps.iter().rposition(Option::is_some).map_or(0, |i| i + 1);
    maps[..last].iter().map(|map| map.as_ref().map(|map| (map.size, map.levels[0][0][0]))).collect()
}

fn put(app: &mut App, layers: &[&CloudLayer]) -> Vec<Option<(u32, u8)>> {
    app.insert_resource(CloudLayers(layers.iter().map(|layer| (*layer).clone()).collect()));
    app.update();
    shown(app)
}

fn until_made(app: &mut App) {
    let start = std::time::Instant::now();
    while app.world().resource::<LayerMaps>().published().pending {
        assert!(start.elapsed().as_secs() < 60, "a map is not made in a minute");
        app.update();
    }
}

#[test]
fn a_removed_layers_map_is_gone_with_its_size() {
    let mut app = app();
    let (large, small) = (painted(&mut app, "a", 256, 200), painted(&mut app, "b", 64, 100));
    assert_eq!(put(&mut app, &[&small, &large]), [Some((256, 100)), Some((256, 200))]);
    assert_eq!(put(&mut app, &[&small]), [Some((64, 100))]);
    // A layer that is added shows nothing until its own map is there.
    assert_eq!(put(&mut app, &[&small, &slow(1)]), [Some((64, 100))]);
    until_made(&mut app);
    assert_eq!(shown(&app).len(), 2);
    assert_eq!(put(&mut app, &[]), []);
    assert_eq!(put(&mut app, &[&slow(2)]), []);
}

#[test]
fn maps_follow_their_layers_through_the_list() {
    let mut app = app();
    let (a, b) = (painted(&mut app, "a", 64, 200), painted(&mut app, "b", 64, 100));
    assert_eq!(put(&mut app, &[&a, &b]), [Some((64, 200)), Some((64, 100))]);
    assert_eq!(put(&mut app, &[&b, &a]), [Some((64, 100)), Some((64, 200))]);
    assert_eq!(put(&mut app, &[&b]), [Some((64, 100))]);
    assert_eq!(put(&mut app, &[&a, &b]), [Some((64, 200)), Some((64, 100))]);
    // The last good map stays while another is made for the same layer, in a list that changes meanwhile too.
    let later = CloudLayer { map_image: None, ..CloudLayer { name: "a".to_owned(), ..slow(3) } };
    assert_eq!(put(&mut app, &[&later, &b]), [Some((64, 200)), Some((64, 100))]);
    assert_eq!(put(&mut app, &[&b, &later]), [Some((64, 100)), Some((64, 200))]);
    // One of another name in its place is another layer.
    let other = CloudLayer { name: "c".to_owned(), ..slow(4) };
    assert_eq!(put(&mut app, &[&b, &other]), [Some((64, 100))]);
    // A hidden layer keeps its map.
    let hidden = CloudLayer { enabled: false, ..b.clone() };
    assert_eq!(put(&mut app, &[&hidden])[0], Some((64, 100)));
}

#[test]
fn images_that_change_or_go_bad() {
    let mut app = app();
    let layer = painted(&mut app, "a", 64, 200);
    assert_eq!(put(&mut app, &[&layer]), [Some((64, 200))]);
    let id = layer.map_image.as_ref().expect("it has one").id();
    let one = |format, texel: &[u8]| {
        let size = Extent3d { width: 8, height: 8, depth_or_array_layers: 1 };
        Image::new_fill(size, TextureDimension::D2, texel, format, RenderAssetUsages::default())
    };
    let change = |app: &mut App, image| {
        app.world_mut().resource_mut::<Assets<Image>>().insert(id, image).expect("the asset is there");
        // Assets tell of it after the frame in which they changed.
        app.update();
        app.update();
        shown(app)
    };
    assert_eq!(change(&mut app, one(TextureFormat::R8Unorm, &[50])), [Some((8, 50))]);
    assert_eq!(change(&mut app, one(TextureFormat::R8Snorm, &[50])), [Some((8, 50))], "the last good one stays");
    assert_eq!(change(&mut app, one(TextureFormat::R8Unorm, &[90])), [Some((8, 90))]);
    let green = CloudLayer { map_channels: MapChannels::Green, ..layer };
    assert_eq!(put(&mut app, &[&green]), [Some((8, 90))], "there is no green");
    assert_eq!(change(&mut app, one(TextureFormat::Rg8Unorm, &[90, 70])), [Some((8, 70))]);
}
