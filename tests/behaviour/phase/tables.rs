//! Phase functions that are tables: Mie's theory against published numbers, shader against CPU, and light through them
//! against adding–doubling.

use std::f64::consts::PI;

use bevy::{
    light::light_consts::lux,
    math::DVec3,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BufferInitDescriptor,
            BufferUsages, PipelineCache, ShaderStages, binding_types::storage_buffer_read_only_sized,
        },
        renderer::RenderDevice,
    },
};
use bevy_cumulus::{
    CloudPhaseStatus, CloudPhaseTable, CloudPhaseTables, ModelPhases,
    prelude::*,
    reference::{
        ice,
        mie::{self, Sphere, WAVELENGTHS, water_index},
        phase::{HgDraine, Phase, hg},
        phase_table::PhaseTable,
    },
};

use super::slots::{middle, of, single};
use crate::support::{
    adding_doubling::{Slab, gauss, moments},
    app::{spawn_sun, until_drawn},
    evaluate::worst,
    gpu::{run_compute_with_groups, run_until, run_updates, shader_app},
    path_trace::{assert_near, frames, light_from, mean, mixed_slab, noise, spawn_pinhole, sun_light, traced_app},
};

/// ∫ f dω over a table's own nodes and some between, by colour.
fn over_sphere(table: &PhaseTable, f: impl Fn(f64) -> f64) -> DVec3 {
    let nodes = 40_000;
    let mut sum = DVec3::ZERO;
    for k in 0..nodes {
        let s = (f64::from(k) + 0.5) / f64::from(nodes);
        let weight = 2.0 * PI * 4.0 * s.powi(3) / f64::from(nodes);
        for cosine in [1.0 - s.powi(4), s.powi(4) - 1.0] {
            sum += table.value(cosine) * f(cosine) * weight;
        }
    }
    sum
}

fn degrees(angle: f64) -> f64 {
    angle.to_radians().cos()
}

#[test]
fn spheres_scatter_as_published() {
    // x; m; efficiency; asymmetry. The first from Bohren and Huffman's appendix A (radius 0.525 µm, wavelength 0.6328 µm),
    // the others from Wiscombe's report on MIEV0 (1979).
    let appendix = 2.0 * PI * 0.525 / 0.6328;
    for (x, m, efficiency, asymmetry) in [
        (appendix, 1.55, 3.10543, 0.63314),
        (10.0, 1.5, 2.881999, 0.742913),
        (100.0, 1.5, 2.094388, 0.818246),
        (1000.0, 1.5, 2.013945, 0.827882),
        (10.0, 0.75, 2.232265, 0.896473),
        (1000.0, 0.75, 1.997908, 0.844944),
    ] {
        let found = Sphere::new(x, m).efficiencies();
        for (what, found, published) in [
            ("Qsca", found.scattering, efficiency),
            ("Qext", found.extinction, efficiency),
            ("g", found.asymmetry, asymmetry),
        ] {
            assert!((found - published).abs() < 1e-5, "{what} at x = {x}, m = {m}: {found}, not {published}");
        }
    }
    let back = Sphere::new(appendix, 1.55).efficiencies().backscattering;
    assert!((back - 2.92534).abs() < 1e-5, "Qback {back}");
    // Sodium's line: 1.33299 at 20 °C, and 0.0001 less a degree.
    assert!((water_index(0.5893) - 1.33284).abs() < 5e-5, "{}", water_index(0.5893));
}

#[test]
fn droplets_of_all_sizes_add_up_to_their_table() {
    // The same distribution of sizes, of efficiencies in place of amplitudes, with all resonances.
    let (diameter, b) = (8.0, mie::EFFECTIVE_VARIANCE);
    let table = mie::droplets(diameter);
    for (channel, wavelength) in WAVELENGTHS.into_iter().enumerate() {
        let effective = PI * diameter / wavelength;
        let (mut turned, mut all) = (0.0, 0.0);
        for k in 0..4000 {
            let x = 0.05 * (f64::from(k) + 0.5);
            let count = x.powf((1.0 - 3.0 * b) / b) * (-x / (effective * b)).exp();
            let found = Sphere::new(x, water_index(wavelength)).efficiencies();
            let weight = count * x * x * found.scattering;
            (turned, all) = (turned + weight * found.asymmetry, all + weight);
        }
        let found = table.mean_cosine()[channel];
        assert!((found - turned / all).abs() < 2e-3, "{wavelength} µm: {found}, not {}", turned / all);
    }
    let total = over_sphere(&table, |_| 1.0);
    assert!((total - DVec3::ONE).abs().max_element() < 1e-4, "{total}");
    let cosine = over_sphere(&table, |x| x);
    assert!((cosine - table.mean_cosine()).abs().max_element() < 1e-4, "{cosine}");
    // The fit that stands in for it has nearly the same asymmetry (its own sizes are spread in another way).
    let fit = Phase::HgDraine(HgDraine::from_diameter(diameter).unwrap()).mean_cosine();
    assert!((table.mean_cosine().y - fit).abs() < 0.02, "{}, and the fit {fit}", table.mean_cosine());
    assert!((table.narrow_share().y - 0.45).abs() < 0.12, "{}", table.narrow_share());
}

/// Angle (degrees) of the greatest value between two angles, in a colour.
fn brightest(table: &PhaseTable, channel: usize, from: f64, to: f64) -> f64 {
    let steps = 2000;
    let at = |k: i32| from + (to - from) * f64::from(k) / f64::from(steps);
    let best = (0..=steps)
        .max_by(|a, b| table.value(degrees(at(*a)))[channel].total_cmp(&table.value(degrees(at(*b)))[channel]));
    at(best.unwrap())
}

#[test]
fn droplets_show_corona_fogbow_and_glory() {
    let table = mie::droplets(14.0);
    // The fogbow: brighter than on either side, within the geometric rainbow, its red on the outer side.
    let at = |angle: f64| table.value(degrees(angle)).y;
    let colour = |angle: f64| table.value(degrees(angle)).x / table.value(degrees(angle)).z;
    let bow = brightest(&table, 1, 130.0, 150.0);
    assert!((138.0..146.0).contains(&bow), "the bow is at {bow}°");
    assert!(at(bow) > 3.0 * at(120.0) && at(bow) > 1.5 * at(150.0), "no bow");
    assert!(colour(134.0) > 1.3 && colour(bow) < 1.0, "{} and {}", colour(134.0), colour(bow));
    // The glory: rings around the point opposite the sun, red outside of blue.
    let [red, _, blue] = [0, 1, 2].map(|channel| brightest(&table, channel, 172.0, 179.0));
    assert!(red < blue - 0.2 && blue < 179.0, "red at {red}°, blue at {blue}°");
    assert!(at(red) > 2.0 * at(170.0), "no glory");
    // The corona: blue light is turned less, so that the sun's surroundings turn red outwards.
    assert!(colour(0.2) < 0.7 && colour(2.2) > 1.5, "{} and {}", colour(0.2), colour(2.2));
}

#[test]
fn ice_has_the_asymmetry_of_cirrus_and_its_halo_where_it_belongs() {
    for halo in [0.0, 0.5, 1.0] {
        let table = ice::table(halo);
        let total = over_sphere(&table, |_| 1.0);
        assert!((total - DVec3::ONE).abs().max_element() < 1e-4, "{total}");
        let g = table.mean_cosine();
        assert!(g.min_element() > 0.75 && g.max_element() < 0.8, "halo {halo}: asymmetry {g}");
        assert!((table.narrow_share() - 0.5).abs().max_element() < 0.1, "{}", table.narrow_share());
        // All of the peak lies within 6 degrees, and most of it within 2.
        let narrow = table.narrow_mean_cosine();
        assert!((degrees(4.0)..1.0).contains(&narrow), "{narrow}");
        let ring = table.value(degrees(23.0)) / table.value(degrees(20.5));
        if halo == 0.0 {
            assert!(ring.max_element() < 1.0, "rough crystals have a halo: {ring}");
        } else {
            assert!(ring.min_element() > 1.5, "no halo: {ring}");
            // The inner edge is red.
            let edge = table.value(degrees(21.75));
            assert!(edge.x > 1.2 * edge.z, "{edge}");
            let [red, _, blue] = [0, 1, 2].map(|channel| brightest(&table, channel, 20.0, 30.0));
            assert!((21.5..22.3).contains(&red) && (red + 0.2..22.9).contains(&blue), "{red}° and {blue}°");
        }
    }
    // Where the rest meets the stand-in for late octaves.
    let stand_in = Phase::HgDraine(ice::stand_in()).mean_cosine();
    assert!((stand_in - ice::table(0.0).mean_cosine().y).abs() < 0.01, "{stand_in}");
}

/// Three tables unlike each other in colour and peak.
fn tables() -> [PhaseTable; 3] {
    let colours = PhaseTable::from_fn(|angle| {
        let x = angle.cos();
        DVec3::new(hg(0.7, x), hg(-0.3, x), 1.0 + x * x)
    });
    [mie::droplets(6.0), ice::table(1.0), colours]
}

/// A group 2 with these tables, after an empty group 1.
fn table_groups(app: &App, tables: &[PhaseTable]) -> [(BindGroupLayoutDescriptor, BindGroup); 2] {
    let world = app.sub_app(RenderApp).world();
    let device = world.resource::<RenderDevice>();
    let layout = BindGroupLayoutDescriptor::new(
        "test tables",
        &BindGroupLayoutEntries::with_indices(
            ShaderStages::COMPUTE,
            ((10, storage_buffer_read_only_sized(false, None)),),
        ),
    );
    let empty = BindGroupLayoutDescriptor::new("test nothing", &[]);
    let texels: Vec<[f32; 4]> = tables.iter().flat_map(PhaseTable::on_gpu).collect();
    let buffer = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("test tables"),
        contents: bytemuck::cast_slice(&texels),
        usage: BufferUsages::STORAGE,
    });
    let cache = world.resource::<PipelineCache>();
    let nothing = device.create_bind_group("test nothing", &cache.get_bind_group_layout(&empty), &[]);
    let entries = BindGroupEntries::with_indices(((10, buffer.as_entire_binding()),));
    let group = device.create_bind_group("test tables", &cache.get_bind_group_layout(&layout), &entries);
    [(empty, nothing), (layout, group)]
}

const READ: &str = "
import bevy_cumulus::render::march::table::{table_phase, table_narrow, table_broad, table_narrow_share};
@group(0) @binding(0) var<storage, read> values: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if 2u * id.x >= arrayLength(&values) { return; }
    let slot = u32(values[2u * id.x]);
    let value = table_phase(slot, values[2u * id.x + 1u]);
    for (var i = 0u; i < 3u; i++) { results[3u * id.x + i] = value[i]; }
}";

#[test]
fn the_shader_reads_what_the_table_holds() {
    let tables = tables();
    let cosines: Vec<f32> = (0..3000)
        .map(|k| {
            let s = f64::from(k) / 2999.0;
            (if k % 2 == 0 { 1.0 - 2.0 * s.powi(5) } else { 2.0 * s.powi(5) - 1.0 }) as f32
        })
        .collect();
    let inputs: Vec<[f32; 2]> =
        (0..3).flat_map(|slot| cosines.iter().map(move |cosine| [slot as f32, *cosine])).collect();
    let mut app = shader_app();
    let groups = table_groups(&app, &tables);
    let count = inputs.len();
    let found = run_compute_with_groups(&mut app, READ, &groups, inputs.as_flattened(), 3 * count, count as u32);
    let (error, input) = worst(inputs.iter().zip(found.as_chunks::<3>().0).map(|(input, found)| {
        let exact = tables[input[0] as usize].value(input[1].into());
        let error = (0..3).map(|i| (f64::from(found[i]) / exact[i] - 1.0).abs()).fold(0.0, f64::max);
        (error, *input)
    }));
    println!("tables: worst {error} of the value, at {input:?}");
    assert!(error < 1e-4, "{error} of the value, at {input:?}");
}

#[test]
fn directions_follow_the_table() {
    const COUNT: usize = 1 << 16;
    let tables = tables();
    let mut app = shader_app();
    let groups = table_groups(&app, &tables);
    for (slot, table) in tables.iter().enumerate() {
        for colour in 0..3 {
            let source = format!(
                "import bevy_cumulus::reference::path_tracer::rng::{{Rng, random, seed_rng}};
                import bevy_cumulus::render::march::table::{{table_narrow_share, draw_front, draw_broad, NARROW}};
                @group(0) @binding(0) var<storage, read> values: array<f32>;
                @group(0) @binding(1) var<storage, read_write> results: array<f32>;
                @compute @workgroup_size(64)
                fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                    if id.x >= {COUNT}u {{ return; }}
                    var rng = seed_rng(vec2(id.x & 255u, id.x >> 8u), 5u, 0u);
                    var versine: f32;
                    if random(&rng) < table_narrow_share({slot}u)[{colour}] {{
                        versine = draw_front({slot}u, NARROW, {colour}u, random(&rng));
                    }} else {{
                        versine = draw_broad({slot}u, {colour}u, random(&rng));
                    }}
                    results[id.x] = versine;
                }}"
            );
            let found = run_compute_with_groups(&mut app, &source, &groups, &[0.0], COUNT, COUNT as u32);
            // Bins of about equal chance, from the table's own sums.
            let fine = 1 << 16;
            let edge = |k: i32| {
                let t = 2.0 * f64::from(k) / f64::from(fine) - 1.0;
                1.0 - t.signum() * (1.0 - (1.0 - t.abs()).powi(4))
            };
            let (mut bins, mut chances, mut edges, mut chance) = (vec![], vec![], vec![], 0.0);
            for k in (0..fine).rev() {
                // From 1 − cosθ = 0 on.
                let (a, b) = (edge(k + 1), edge(k));
                chance += 2.0 * PI * table.value(1.0 - 0.5 * (a + b))[colour] * (b - a);
                if chance > 1.0 / 40.0 {
                    chances.push(chance);
                    edges.push(b);
                    chance = 0.0;
                }
            }
            chances.push(1.0 - chances.iter().sum::<f64>());
            bins.resize(chances.len(), 0_u32);
            for versine in &found {
                bins[edges.partition_point(|edge| *edge <= f64::from(*versine))] += 1;
            }
            let chi2: f64 = bins
                .iter()
                .zip(&chances)
                .map(|(n, p)| (f64::from(*n) - p * COUNT as f64).powi(2) / (p * COUNT as f64))
                .sum();
            let freedom = (bins.len() - 1) as f64;
            println!("table {slot}, colour {colour}: χ² = {chi2:.1} at {freedom} degrees of freedom");
            assert!(chi2 < freedom + 5.0 * (2.0 * freedom).sqrt(), "table {slot}, colour {colour}: χ² = {chi2}");
        }
    }
}

/// Puts a table into the lighting's own slot.
fn insert_table(app: &mut App, slot: usize, table: PhaseTable) {
    let mut assets = app.world_mut().resource_mut::<Assets<CloudPhaseTable>>();
    let handle = assets.add(CloudPhaseTable(table.into()));
    app.world_mut().resource_mut::<CloudPhaseTables>().tables[slot] = Some(handle);
    run_updates(app, 2);
}

#[test]
fn the_march_shows_tables_in_colour() {
    let albedo = 0.9;
    let lighting = CloudLighting {
        fade_start: 1.0,
        aerial_perspective: 0.0,
        droplet_diameter: 6.0,
        halo: 1.0,
        ..sun_light(PhaseFunction::Mie)
    };
    let shares = [0.3, 0.3, 0.4, 0.0];
    let mut app = traced_app(Some(mixed_slab(0.5, [albedo; 3], shares)), lighting.clone());
    let ice = CloudPhase { halo: 1.0, ..of(PhaseFunction::Ice, 0.0) };
    app.insert_resource(ModelPhases(vec![ice, of(PhaseFunction::Table, 0.2)]));
    let sun = spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::ONE, 1.0);
    single(&mut app, CloudLighting { phase_limit: 1e5, ..lighting });
    until_drawn(&mut app);
    run_until(&mut app, "the table of droplets", 100, |app| !app.world().resource::<CloudPhaseStatus>().computing);
    let tables = tables();
    insert_table(&mut app, 2, tables[2].clone());
    for angle in [0.5_f32, 2.0, 22.0, 90.0, 141.0, 178.0] {
        let seen = middle(&mut app, &view, sun, angle);
        let values = tables.iter().zip(shares).map(|(table, share)| share * table.value(degrees(angle.into())));
        let phase: DVec3 = values.sum();
        for channel in 0..3 {
            let exact = f64::from(lux::RAW_SUNLIGHT) * albedo * phase[channel] * (1.0 - (-0.5_f64).exp());
            assert_near(seen[channel].into(), exact, 5e-3, &format!("{angle}°, colour {channel}"));
        }
    }
}

/// Colours that scatter each in their own way share their paths: as much light of each must arrive as if it were alone.
/// The first has a narrow peak, which is followed from the sun backwards.
#[test]
fn the_path_tracer_traces_tables_as_adding_says() {
    let (depth, albedo, mu, n) = (2.0, 0.95, 0.75, 200);
    let droplets = HgDraine::from_diameter(5.0).unwrap();
    let phase = |x: f64| DVec3::new(droplets.value(x), hg(0.5, x), hg(0.8, x));
    let table = PhaseTable::from_fn(|angle| phase(angle.cos()));
    let slabs = [0, 1, 2].map(|channel| {
        let n = if channel == 0 { n } else { 24 };
        Slab::new(depth, albedo, &moments(2 * n, |x| phase(x)[channel]), n, mu)
    });
    for up in [1.0, -1.0] {
        let mut app =
            traced_app(Some(mixed_slab(depth, [albedo; 3], [1.0, 0.0, 0.0, 0.0])), sun_light(PhaseFunction::Table));
        insert_table(&mut app, 0, table.clone());
        spawn_sun(&mut app, light_from(mu));
        let view = spawn_pinhole(&mut app, UVec2::new(128, 96), up);
        let found = mean(&mut app, &view, frames(160));
        for (found, slab) in found.into_iter().zip(&slabs) {
            let [above, below] = slab.sun_seen_vertically();
            let expected = f64::from(lux::RAW_SUNLIGHT) * if up > 0.0 { below } else { above };
            assert_near(found, expected, 1.2 * noise(), &format!("looking {up}"));
        }
    }
}

#[test]
fn a_slider_over_droplets_keeps_the_last_table_until_the_next_is_there() {
    let mut app = traced_app(Some(mixed_slab(0.5, [0.9; 3], [1.0, 0.0, 0.0, 0.0])), CloudLighting::default());
    let lighting = CloudLighting {
        fade_start: 1.0,
        aerial_perspective: 0.0,
        droplet_diameter: 6.0,
        ..sun_light(PhaseFunction::Mie)
    };
    let sun = spawn_sun(&mut app, Vec3::NEG_Y);
    let view = spawn_pinhole(&mut app, UVec2::ONE, 1.0);
    single(&mut app, lighting.clone());
    until_drawn(&mut app);
    let computed = |app: &mut App| {
        run_until(app, "the table of droplets", 100, |app| !app.world().resource::<CloudPhaseStatus>().computing);
        run_updates(app, 2);
    };
    computed(&mut app);
    let small = middle(&mut app, &view, sun, 141.0);
    single(&mut app, CloudLighting { droplet_diameter: 9.0, ..lighting });
    // At first the old table; then the new one.
    assert_eq!(middle(&mut app, &view, sun, 141.0), small);
    computed(&mut app);
    let large = middle(&mut app, &view, sun, 141.0);
    let expected = mie::droplets(9.0).value(degrees(141.0)) / mie::droplets(6.0).value(degrees(141.0));
    for channel in 0..3 {
        assert_near((large[channel] / small[channel]).into(), expected[channel], 3e-3, &format!("colour {channel}"));
    }
}

#[test]
fn tables_of_text_are_read_and_bad_ones_name_file_and_line() {
    let good = "# Haze\nangle, value\n0, 10\n\n90, 1.5 # sideways\n180,2\n";
    let table = CloudPhaseTable::parse(good, "haze.phase.csv").unwrap().0;
    assert_near(table.value(1.0).x / table.value(-1.0).x, 5.0, 1e-9, "ends");
    assert_near(table.value(degrees(45.0)).y / table.value(-1.0).y, 2.875, 1e-4, "middle");
    let total = gauss(400).iter().map(|(x, w)| 2.0 * PI * 2.0 * w * table.value(2.0 * x - 1.0).z).sum::<f64>();
    assert_near(total, 1.0, 1e-3, "integral");
    let coloured = CloudPhaseTable::parse("0,1,2,3\n180,1,1,1", "c").unwrap().0;
    assert_near(coloured.value(1.0).z / coloured.value(-1.0).z, 3.0, 1e-9, "blue");
    for (text, says) in [
        ("0,1\n50,1,1\n180,1", "t.phase.csv:2: 3 columns, but 2 (angle, value) or 4"),
        (
            "0,1\n50,1,1,1\n180,1",
            "t.phase.csv:2: 4 columns, but 2 (angle, value) or 4 (angle, red, green, blue) are \
                                  needed; the lines before have 2",
        ),
        ("0,1\n50,x\n180,1", "t.phase.csv:2: \"x\" is not a number"),
        ("0,1\n50,1\n50,1\n180,1", "t.phase.csv:3: the angle 50 must be above 50"),
        ("0,1\n190,1", "t.phase.csv:2: the angle 190 must be above 0, the one before, and at most 180"),
        ("-1,1\n180,1", "t.phase.csv:1: the angle -1 must be above 0"),
        ("0,1\n90,-0.5\n180,1", "t.phase.csv:2: the value -0.5 is outside its range 0 to 1e30"),
        ("0,1\n90,NaN\n180,1", "t.phase.csv:2: the value NaN is outside"),
        ("0,1\n90,2", "t.phase.csv: the angles go from 0 to 90, but 0 to 180 are needed"),
        ("angle,value\n", "t.phase.csv: there is no line with numbers"),
        ("0,0,1,1\n180,0,1,1", "t.phase.csv: all values of a column are 0"),
    ] {
        let error = CloudPhaseTable::parse(text, "t.phase.csv").expect_err(text).to_string();
        assert!(error.starts_with(says), "{error:?}, not {says:?}");
    }
}
