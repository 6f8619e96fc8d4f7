//! Which table each slot has, without a renderer.

use std::{fs, path::Path};

use bevy::asset::LoadState;

use super::*;
use crate::{
    CloudsPlugin,
    settings::{CloudLayer, CloudLayers},
};

fn app(folder: &Path) -> App {
    let mut app = App::new();
    let assets = AssetPlugin { file_path: folder.to_string_lossy().into_owned(), ..default() };
    app.add_plugins((MinimalPlugins, assets, CloudsPlugin));
    app.finish();
    app.cleanup();
    app
}

fn layer(file: &str) -> CloudLayer {
    let phase = CloudPhase { function: PhaseFunction::Table, ..default() };
    CloudLayer { own_phase: true, phase, phase_file: file.to_owned(), ..default() }
}

/// Mean cosines of the tables of slots 1 to 3, once all files have loaded or failed.
fn cosines(app: &mut App, layers: &[CloudLayer]) -> [Option<f64>; 3] {
    app.insert_resource(CloudLayers(layers.to_vec()));
    let start = std::time::Instant::now();
    loop {
        app.update();
        let server = app.world().resource::<AssetServer>();
        let files = &app.world().resource::<TableFiles>().loaded;
        let is_loading = |id| matches!(server.get_load_state(id), Some(LoadState::Loading));
        if !files.iter().any(|(_, handle)| is_loading(handle.id())) {
            break;
        }
        assert!(start.elapsed().as_secs() < 60, "a table does not load in a minute");
    }
    app.update();
    app.update();
    let ready = app.world().resource::<ReadyTables>();
    [1, 2, 3].map(|slot| ready.get(slot, PhaseFunction::Table).map(|table| table.mean_cosine().y))
}

#[test]
fn a_table_belongs_to_its_layer_and_not_to_a_slot() {
    let folder = std::env::temp_dir().join(format!("cumulus-tables-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("the temporary folder can be written");
    for (file, text) in [("on.phase.csv", "0,9\n180,1"), ("back.phase.csv", "0,1\n180,9"), ("bad.phase.csv", "0,1")] {
        fs::write(folder.join(file), text).expect("the folder can be written");
    }
    let mut app = app(&folder);
    let (on, back, bad) = (layer("on.phase.csv"), layer("back.phase.csv"), layer("bad.phase.csv"));
    let signs = |app: &mut App, layers: &[&CloudLayer]| {
        let layers: Vec<CloudLayer> = layers.iter().map(|layer| (*layer).clone()).collect();
        cosines(app, &layers).map(|cosine| cosine.map(|cosine| cosine > 0.0))
    };
    assert_eq!(signs(&mut app, &[&on, &back]), [Some(true), Some(false), None]);
    assert_eq!(signs(&mut app, &[&back, &on, &back]), [Some(false), Some(true), None]);
    assert_eq!(signs(&mut app, &[&on]), [Some(true), None, None]);
    // Another function has nothing to do with the file.
    let plain = CloudLayer { phase: CloudPhase::default(), ..on.clone() };
    assert_eq!(signs(&mut app, &[&plain, &back]), [None, Some(false), None]);
    // A file that is none leaves the slot to its own table, and there is none.
    assert_eq!(signs(&mut app, &[&bad, &on]), [None, Some(true), None]);
    let _ = fs::remove_dir_all(&folder);
}
