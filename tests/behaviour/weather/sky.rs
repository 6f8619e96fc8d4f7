//! Reports and the state of the air as layers of clouds.

use bevy::prelude::*;
use bevy_cumulus::{
    prelude::*,
    settings::{LayerKind, Validate},
    weather::{Steering, metar::MetarSky},
};

fn layers(line: &str, elevation: f32) -> Vec<CloudLayer> {
    let sky = MetarSky::parse(line, elevation).unwrap_or_else(|error| panic!("{line}: {error}"));
    let layers = CloudLayers::from_metar(&sky, 50.0, 0);
    layers.validate().unwrap_or_else(|error| panic!("{line}: {error}"));
    layers.0
}

#[test]
fn a_report_becomes_layers_with_its_cover_bases_and_wind() {
    let all = layers("METAR EGLL 231150Z 24012KT 9999 FEW022 SCT035 BKN250 12/07 Q1013", 25.0);
    let told: Vec<(&str, f32, f32)> = all.iter().map(|l| (&*l.name, l.map.cover, l.base.round())).collect();
    assert_eq!(told, [("cumulus 0", 1.5, 696.0), ("cumulus 1", 3.5, 1092.0), ("cirrus 2", 6.0, 7645.0)]);
    assert_eq!(all[2].kind, LayerKind::Sheet);
    assert!(all.iter().all(|layer| layer.rain == 0.0));
    // From the west-southwest towards the east-northeast; faster and further to the right above.
    let winds = all.iter().map(|l| l.wind).collect::<Vec<_>>();
    assert!(winds[0].x > 6.2 && winds[0].z < 0.0, "{winds:?}");
    assert!(winds[2].length() > winds[0].length() && winds[2].x.atan2(-winds[2].z) > winds[0].x.atan2(-winds[0].z));
    assert_ne!(all[0].map.seed, all[1].map.seed);
    assert_eq!(layers("LEMD 231200Z 00000KT CAVOK 30/05 Q1018", 600.0), []);
}

#[test]
fn it_rains_from_the_cloud_that_rain_falls_from() {
    let storm = layers("KMCO 032153Z 20015G30KT 3SM +TSRA BKN020CB OVC080 24/22 A2990", 29.0);
    assert_eq!((&*storm[0].name, &*storm[1].name), ("cumulonimbus 0", "altostratus 1"));
    assert!(storm[0].top() > 11_000.0 && storm[0].anvil > 0.5);
    assert_eq!((storm[0].rain, storm[1].rain), (1.0, 0.0));
    // Three miles: 3.912/4828 m, and shafts to the ground.
    assert!((storm[0].rain_extinction - 8.1e-4).abs() < 1e-5, "{}", storm[0].rain_extinction);
    assert!((storm[0].bottom() - 29.0).abs() < 1.0);
    let steady = layers("EDDH 101220Z 27008KT 9999 RA FEW008 OVC015 09/08 Q1002", 16.0);
    assert_eq!((&*steady[0].name, &*steady[1].name), ("cumulus 0", "nimbostratus 1"));
    assert!(steady[0].rain == 0.0 && (0.3..0.9).contains(&steady[1].rain), "{}", steady[1].rain);
    // Seen far: by the rate, 5 mm/h.
    assert!((steady[1].rain_extinction - 7.28e-4).abs() < 1e-5, "{}", steady[1].rain_extinction);
    let showers = layers("ENBR 201350Z 31018KT 9999 SHRA FEW012TCU SCT030 07/03 Q0995", 50.0);
    assert!(showers[0].name.starts_with("congestus") && showers[0].rain > 0.0 && showers[1].rain == 0.0, "{showers:?}");
}

#[test]
fn it_does_not_rain_where_the_report_has_no_precipitation() {
    for line in [
        "MDSD 192000Z 08008KT 9999 FEW020CB SCT022 BKN300 32/25 Q1012",
        "UUDD 291130Z 22005MPS 8000 TS SCT033CB 13/10 Q1003",
        "EDDF 041120Z 27012KT 9999 VCSH BKN012CB 21/17 Q1016",
    ] {
        let all = layers(line, 0.0);
        assert!(all.iter().any(|layer| layer.name.starts_with("cumulonimbus")), "{line}");
        assert!(all.iter().all(|layer| layer.rain == 0.0), "{line}: {all:?}");
    }
}

#[test]
fn fog_lies_on_the_ground() {
    let all = layers("EHAM 050625Z VRB02KT 0200 FG VV001 03/03 Q1030", -3.0);
    assert_eq!(all.len(), 1);
    let fog = &all[0];
    assert_eq!((&*fog.name, fog.base, fog.wind), ("fog", -3.0, Vec3::ZERO));
    assert!((fog.extinction - 3.912 / 200.0).abs() < 1e-6 && fog.thickness < 100.0, "{fog:?}");
    let thin = layers("LFPG 230600Z 05003KT 0700 FG SCT002 BKN150 08/08 Q1025", 119.0);
    assert_eq!(thin.iter().map(|l| &*l.name).collect::<Vec<_>>(), ["fog", "cumulus 0", "altocumulus 1"]);
}

#[test]
fn the_state_of_the_air_brings_its_layers() {
    let summer = Steering { humidity_aloft: 0.9, wind_speed: 6.0, ..default() };
    let layers = summer.layers(100.0, 50.0, 0).expect("good numbers").0;
    assert_eq!(layers.iter().map(|l| &*l.name).collect::<Vec<_>>(), ["convective", "stratiform"]);
    let (_, hints) = summer.steer(&WeatherRecipe::default()).expect("good numbers");
    assert_eq!(layers[0].base, 100.0 + hints.base);
    assert_eq!((layers[0].map.cover, layers[1].map.cover), (hints.convective, hints.stratiform));
    assert!((layers[0].thickness - (hints.top - hints.base)).abs() < 1.0);
    assert!(layers[0].wind.length() > 6.0 && layers[0].wind.z > 0.0, "it veers to the south: {}", layers[0].wind);
    CloudLayers(layers).validate().expect("in range");
    let night = Steering { hour: 3.0, humidity_aloft: 0.4, ..default() };
    assert_eq!(night.layers(0.0, 50.0, 0).expect("good numbers").0, []);
    let bad = Steering { temperature: 99.0, ..default() };
    assert!(bad.sky(0.0, 50.0, 0).unwrap_err().to_string().starts_with("steering.temperature = 99"));
}
