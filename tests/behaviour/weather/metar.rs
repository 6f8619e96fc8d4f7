//! Reports as stations send them.

use bevy::math::Vec3;
use bevy_cumulus::weather::metar::{CloudGroup, CloudKind, MetarError, MetarSky, PrecipitationKind};

fn sky(line: &str) -> MetarSky {
    MetarSky::parse(line, 0.0).unwrap_or_else(|error| panic!("{line}: {error}"))
}

/// Oktas and base in feet.
fn groups(line: &str) -> Vec<(f32, i32)> {
    sky(line).groups.iter().map(|g| (g.oktas, (g.base / 0.3048).round() as i32)).collect()
}

#[test]
fn a_whole_report() {
    let sky = MetarSky::parse("METAR EGLL 231150Z AUTO 24012G24KT 9999 -RA FEW022 SCT035TCU BKN048 12/07 Q1013=", 25.0)
        .unwrap();
    assert_eq!(sky.station, "EGLL");
    let bases: Vec<f32> = sky.groups.iter().map(|g| g.base).collect();
    for (base, feet) in bases.iter().zip([2200.0, 3500.0, 4800.0]) {
        assert!((base - 25.0 - feet * 0.3048).abs() < 0.01, "{base}");
    }
    assert_eq!(sky.groups.iter().map(|g| g.oktas).collect::<Vec<_>>(), [1.5, 3.5, 6.0]);
    assert_eq!(sky.groups.iter().map(|g| g.kind).collect::<Vec<_>>(), [None, Some(CloudKind::ToweringCumulus), None]);
    assert!(sky.groups.iter().all(|g| g.base_is_known && !g.is_obscured));
    let wind = sky.wind.unwrap();
    assert!((wind.speed - 6.173).abs() < 0.001 && (wind.gust.unwrap() - 12.347).abs() < 0.001);
    assert_eq!(wind.from, Some(240.0));
    let rain = sky.precipitation.unwrap();
    assert_eq!((rain.kind, rain.is_showery), (PrecipitationKind::Rain, false));
    assert_eq!((sky.temperature, sky.dew_point, sky.visibility), (Some(12.0), Some(7.0), Some(10_000.0)));
    assert!(!sky.thunderstorm && !sky.fog);
    assert_eq!(sky.elevation, 25.0);
}

#[test]
fn clear_skies_have_no_groups() {
    for line in [
        "LFPG 121200Z 25010KT CAVOK 25/10 Q1020",
        "CYWG 190500Z 16014KT 10SM SKC 19/11 A2959 RMK SLP022",
        "KORD 101851Z VRB03KT P6SM CLR M05/M12 A3010",
        "EDDF 041120Z 27012KT 9999 NCD 21/10 Q1016",
        "VABB 041130Z 27012KT 3000 HZ NSC 31/24 Q1006 NOSIG",
        "KPHF 191054Z 00000KT 5SM BR CLR 11/11 A3003 RMK AO2 SLP168 T01110111",
    ] {
        assert_eq!(groups(line), [], "{line}");
    }
}

/// Reports from around the world, each with the groups it tells of.
#[test]
fn real_reports() {
    let all: [(&str, &[(f32, i32)]); 28] = [
        ("KJFK 121951Z 18015G25KT 10SM -RA BKN015 OVC025 18/16 A2992 RMK AO2 SLP132", &[(6.0, 1500), (8.0, 2500)]),
        ("SPECI KDEN 101853Z 36010KT 2 1/2SM -SN OVC008 M02/M03 A3001", &[(8.0, 800)]),
        ("KDEN 101853Z 36010KT M1/4SM FZFG VV001 M02/M03 A3001", &[(8.0, 100)]),
        ("KLAX 281253Z 24005KT 1/8SM R25L/2600VP6000FT FG VV002 17/16 A2999 RMK AO2 SLP152 VIS E 1/4", &[(8.0, 200)]),
        (
            "KPVG 181956Z AUTO 10SM FEW030 SCT035 BKN050 A2982 RMK AO2 SLPNO FZRANO PNO $",
            &[(1.5, 3000), (3.5, 3500), (6.0, 5000)],
        ),
        ("KFCI 200356Z AUTO 00000KT SCT070 15/15 RMK AO2 SLPNO T01500150 PWINO $", &[(3.5, 7000)]),
        ("KGWW 191150Z AUTO 00000KT 14/14 A3007 RMK AO2 70001", &[]),
        (
            "KABC 121755Z AUTO 21016G24KT 180V240 1SM R11/P6000FT -RA BR BKN015 OVC025 06/04 A2990 RMK AO2 PK WND 20032/25",
            &[(6.0, 1500), (8.0, 2500)],
        ),
        (
            "EDDK 021250Z AUTO 17014KT 150V220 9999 3000 SHRA BR FEW025 BKN042 BKN049 FEW///CB 21/18 Q0992 TEMPO NSW",
            &[(1.5, 2500), (6.0, 4200), (6.0, 4900), (1.5, 1246)],
        ),
        ("METAR EGOS 160620Z AUTO 31006KT 9999 // FEW067/// BKN087/// 10/09 Q1017", &[(1.5, 6700), (6.0, 8700)]),
        ("UUDD 040830Z 20005MPS 170V240 9999 SCT039 27/17 Q1011 R88/60D NOSIG", &[(3.5, 3900)]),
        (
            "UUDD 291130Z 22005MPS 8000 2300E -TSRA SCT033CB 13/10 Q1003 RESHRA RESHGR R88/290045 TEMPO 1000 TSRA",
            &[(3.5, 3300)],
        ),
        ("ESSA 210950Z 25010KT 210V280 9999 SCT029 17/10 Q1002 TEMP0 SCT035CB", &[(3.5, 2900)]),
        ("EGPC 211350Z VRB03KT 9999 3000NE SHRA FEW006 BKN012CB 15/14 Q1009 RETSRA RESHRA", &[(1.5, 600), (6.0, 1200)]),
        (
            "MDSD 192000Z 08008KT 9999 FEW020CB FEW022 BKN300 32/25 Q1012 CB/NE/E/W",
            &[(1.5, 2000), (1.5, 2200), (6.0, 30000)],
        ),
        ("EDDM 121820Z 00000KT 0500 R26L/0600N FG VV/// 03/03 Q1030", &[(8.0, 0)]),
        ("RJTT 121800Z 02012KT 9999 FEW010 SCT015 BKN040 22/19 Q1010 NOSIG", &[(1.5, 1000), (3.5, 1500), (6.0, 4000)]),
        ("ZBAA 121800Z 12003MPS 6000 SCT023 BKN050 26/20 Q1008 NOSIG", &[(3.5, 2300), (6.0, 5000)]),
        ("SBGR 121800Z 12008KT 5000 +RA DZ SCT008 BKN018 16/15 Q1019", &[(3.5, 800), (6.0, 1800)]),
        ("YSSY 120800Z 12008KT 9999 FEW025 SCT040 22/14 Q1018 FM0900 15012KT", &[(1.5, 2500), (3.5, 4000)]),
        ("LIRF 101850Z 12008KT 9999 -SHRA FEW018TCU SCT020 15/13 Q1009", &[(1.5, 1800), (3.5, 2000)]),
        ("NZAA 121800Z AUTO 24015KT 20KM FEW025/// 15/11 Q1015", &[(1.5, 2500)]),
        ("LSZH 121820Z 24005KT 9999 BKN/// 07/M01 Q1013", &[(6.0, 3253)]),
        ("EDDF 041120Z 27012KT 9999 ///015 21/10 Q1016", &[]),
        ("EDDF 041120Z 27012KT 9999 //////CB 21/17 Q1016", &[(1.5, 1659)]),
        ("LOWI 121820Z /////KT //// ////// ///// Q////", &[]),
        ("BIKF 121830Z 09035G48KT 4000 BLSN -SN OVC012 M01/M02 Q0978", &[(8.0, 1200)]),
        ("metar enbr 121820z 18010kt 9999 few010 sct020 08/06 q1001", &[(1.5, 1000), (3.5, 2000)]),
    ];
    let wrong: Vec<String> = all
        .into_iter()
        .filter(|(line, expected)| groups(line) != *expected)
        .map(|(line, _)| format!("{line}: {:?}", groups(line)))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn bases_that_are_missing_are_the_condensation_level() {
    let sky = MetarSky::parse("LSZH 121820Z 24005KT 9999 BKN/// 07/M01 Q1013", 432.0).unwrap();
    let [CloudGroup { base, base_is_known: false, .. }] = sky.groups[..] else { panic!("{sky:?}") };
    assert!((base - 432.0 - 1000.0).abs() < 40.0, "8 K spread: {base}");
    let bare = MetarSky::parse("LSZH 121820Z 24005KT 9999 BKN///", 100.0).unwrap();
    assert_eq!(bare.groups[0].base, 1100.0);
}

#[test]
fn weather_at_the_station() {
    let falls = |weather: &str| {
        let sky = sky(&format!("EGLL 231150Z 24012KT 3000 {weather} OVC010CB 12/07 Q1013"));
        (sky.precipitation.map(|p| (p.kind, p.is_showery)), sky.thunderstorm, sky.fog)
    };
    use PrecipitationKind::*;
    for (weather, expected) in [
        ("RA", (Some((Rain, false)), false, false)),
        ("+SHRA", (Some((Rain, true)), false, false)),
        ("-DZ BR", (Some((Drizzle, false)), false, false)),
        ("+TSRA", (Some((Rain, true)), true, false)),
        ("TS", (None, true, false)),
        ("VCTS", (None, true, false)),
        ("VCSH", (None, false, false)),
        ("TSGR", (Some((Hail, true)), true, false)),
        ("SN BLSN", (Some((Snow, false)), false, false)),
        ("BLSN", (None, false, false)),
        ("PL", (Some((Ice, false)), false, false)),
        ("FG", (None, false, true)),
        ("VCFG", (None, false, false)),
        ("FZDZ FG", (Some((Drizzle, false)), false, true)),
    ] {
        assert_eq!(falls(weather), expected, "{weather}");
    }
    let rate = |weather: &str| {
        let sky = sky(&format!("EGLL 231150Z 24012KT 3000 {weather} OVC010 12/07 Q1013"));
        sky.precipitation.unwrap().rate
    };
    assert!(rate("-RA") < 2.5 && (2.5..10.0).contains(&rate("RA")) && rate("+RA") > 10.0);
    assert!(rate("DZ") < rate("-RA"));
}

#[test]
fn wind_in_all_units_and_axes() {
    let wind = |text: &str| sky(&format!("EGLL 231150Z {text} 9999 FEW022 12/07 Q1013")).wind;
    assert!((wind("27010KT").unwrap().speed - 5.144).abs() < 0.001);
    assert_eq!(wind("27010MPS").unwrap().speed, 10.0);
    assert!((wind("27036KMH".replace("36KMH", "036KPH").as_str()).unwrap().speed - 10.0).abs() < 0.001);
    assert_eq!(wind("/////KT"), None);
    assert_eq!(wind("VRB03KT").unwrap().from, None);
    assert_eq!(wind("00000KT").unwrap().velocity(), Vec3::ZERO);
    // From the west: towards +x, 0 degrees on the map. From the north: towards the south, +z, 90 degrees.
    for (text, velocity, degrees) in [
        ("27010MPS", Vec3::X, 0.0),
        ("36010MPS", Vec3::Z, 90.0),
        ("09010MPS", Vec3::NEG_X, -180.0),
        ("18010MPS", Vec3::NEG_Z, -90.0),
    ] {
        let wind = wind(text).unwrap();
        assert!((wind.velocity() - 10.0 * velocity).length() < 1e-4, "{text}: {}", wind.velocity());
        assert_eq!(wind.map_direction(), Some(degrees), "{text}");
    }
}

#[test]
fn mistakes_name_their_group() {
    for (line, group, number) in [
        ("EDDF 041120Z 27012KT 9999 XXX050 21/10 Q1016", "XXX050", 5),
        ("EDDF 041120Z 27012KT 9999 SCT05 21/10 Q1016", "SCT05", 5),
        ("EDDF 041120Z 27012KT9999 SCT050 21/10 Q1016", "27012KT9999", 3),
        ("EGLL 231150Z 24012KT 9999 FEW022 OVC 12/07 Q1013", "OVC", 6),
        ("EGLL 231150Z 24012KT 9999 OVC022TC 12/07 Q1013", "OVC022TC", 5),
        ("METAR EGLL 231150Z 240112KT 9999 FEW022 12/07 Q1013", "240112KT", 4),
        ("EGLL 451150Z 24012KT 9999 FEW022 12/07 Q1013", "451150Z", 2),
        ("EGLL 231150Z 24012KT 180V300 9999 R27/1200 FEW0A2 12/07 Q1013", "FEW0A2", 7),
        ("EGLL 231150Z 24012KT 9999 SCT05", "SCT05", 5),
        ("EGLL 231150Z 24012KT 9999 SCT050 1207 Q1013", "1207", 6),
        ("ZÜRI 231150Z 24012KT 9999 FEW022 12/07 Q1013", "ZüRI", 1),
    ] {
        match MetarSky::parse(line, 0.0) {
            Err(MetarError::Group { group: found, number: place, .. }) => {
                assert_eq!((found.to_uppercase(), place), (group.to_uppercase(), number), "{line}");
            }
            other => panic!("{line}: {other:?}"),
        }
    }
    assert_eq!(MetarSky::parse("  ", 0.0), Err(MetarError::Empty));
    assert_eq!(MetarSky::parse("METAR", 0.0), Err(MetarError::Empty));
    assert_eq!(MetarSky::parse("EGLL 231150Z NIL", 0.0), Err(MetarError::Nil));
    assert!(matches!(MetarSky::parse("EDDF", 0.0), Err(MetarError::Ends(_))));
    let text = MetarSky::parse("EDDF 041120Z 27012KT 9999 XXX050 21/10 Q1016", 0.0).unwrap_err().to_string();
    assert!(text.starts_with("METAR group 5, \"XXX050\", cannot be read"), "{text}");
}

#[test]
fn no_line_panics() {
    let good =
        "METAR EGLL 231150Z AUTO 24012G24KT 180V240 2 1/2SM R26L/0600N -RA FEW022 SCT035TCU VV/// M12/M07 Q1013 RMK";
    let spare = ['/', ' ', '9', 'V', 'R', 'K', 'é', '\u{3000}', '+'];
    let mut state = 12345_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    for _ in 0..3000 {
        let mut line: Vec<char> = good.chars().collect();
        for _ in 0..4 {
            let at = next() % line.len();
            match next() % 3 {
                0 => line[at] = spare[next() % spare.len()],
                1 => line.insert(at, spare[next() % spare.len()]),
                _ => drop(line.remove(at)),
            }
        }
        let _ = MetarSky::parse(&line.iter().collect::<String>(), 0.0);
    }
    // The library panics on these by itself.
    let _ = MetarSky::parse("EGLL 231150Z 24012KT VRBV240 9999 FEW022 12/07 Q1013", 0.0);
    let _ = MetarSky::parse("EGLL 231150Z 24012KT VRBVVRB 9999 FEW022 12/07 Q1013", 0.0);
}

#[test]
fn groups_become_recipes_of_their_kind() {
    let sky = sky("EGLL 231150Z 27020KT 9999 FEW020 SCT035CB BKN100 OVC250 20/12 Q1013");
    let kinds: Vec<_> = sky.groups.iter().map(|group| sky.pattern(group)).collect();
    assert_eq!(kinds, ["humilis", "congestus", "altocumulus", "altostratus"]);
    for group in &sky.groups {
        let recipe = sky.recipe(group);
        assert_eq!(recipe.cover, group.oktas);
        assert_eq!(recipe.street_direction, 0.0);
        let map = bevy_cumulus::weather::WeatherRecipe { size: 64, ..recipe }.generate().unwrap();
        assert!((map.cover() * 8.0 - group.oktas).abs() < 0.02);
    }
    assert!(sky.recipe(&sky.groups[0]).streets > 0.3, "20 knots");
    assert_eq!(sky.recipe(&sky.groups[2]).streets, 0.0, "no streets in a high deck");
}
