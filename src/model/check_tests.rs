use super::*;

const GOOD: &str = "import bevy_cumulus::{Medium, empty_medium, altitude};

const BASE: f32 = 1000.0; // m
/* a comment
   of two lines */
fn model_bounds() -> vec2<f32> {
    return vec2(BASE, 2000.0);
}
fn density_bound(p: vec3<f32>, lod: f32) -> f32 { return 1.0; }

fn thickness_at(h: f32) -> f32 {
    let a = vec3f(1e-3, 0.5, (h));
    // Between statements.
    return bevy_cumulus::altitude(a,
        6360000.0);
}

fn sample_medium(p: vec3<f32>, lod: f32) -> Medium {
    var medium = empty_medium();
    medium.density = thickness_at(altitude(p, 6360000.0));
    return medium;
}
fn model_deck(i: u32) -> vec2<f32> { return model_bounds(); }
fn model_part(i: u32) -> vec2<f32> { return model_deck(i); }
fn sample_part(i: u32, p: vec3<f32>, lod: f32) -> Medium { return sample_medium(p, lod); }
";

fn verdict(from: &str, to: &str) -> Verdict {
    assert_eq!(GOOD.matches(from).count(), 1, "{from}");
    check(&GOOD.replace(from, to), std::iter::empty())
}

#[test]
fn a_good_model_passes() {
    assert_eq!(check(GOOD, std::iter::empty()), Verdict::Good);
    // The built-in one, too.
    assert_eq!(check(include_str!("model.wesl"), std::iter::empty()), Verdict::Good);
}

#[test]
fn a_mistake_is_found_on_its_line() {
    for (from, to, line, says) in [
        // What the parser finds.
        ("return vec2(BASE, 2000.0);", "return vec2(BASE, 2000.0;", 7, ""),
        ("fn thickness_at(", "fun thickness_at(", 11, ""),
        // A name that is nowhere.
        ("(h));", "(height));", 12, "height"),
        ("empty_medium();\n", "no_medium();\n", 19, "no_medium"),
        // One that is not among those that may be imported.
        ("altitude};", "height as altitude};", 1, "height"),
        // Types.
        ("        6360000.0);", "        true);", 15, ""),
        ("medium.density = ", "medium.density = 1u * ", 20, ""),
        ("medium.density", "medium.thickness", 20, "thickness"),
        ("return medium;", "return 1.0;", 21, ""),
        ("const BASE: f32 = 1000.0", "const BASE: f32 = true", 3, ""),
        // What the renderer calls.
        (
            "density_bound(p: vec3<f32>, lod: f32) -> f32 { return 1.0; }",
            "density_bound(p: vec3<f32>) -> f32 { return 1.0; }",
            9,
            "density_bound must give f32",
        ),
        ("-> f32 { return 1.0; }", "-> vec2<f32> { return vec2(1.0); }", 9, "density_bound must give f32"),
    ] {
        let Verdict::Bad(error) = verdict(from, to) else { panic!("{to} passes") };
        assert!(!error.reason.contains("_1"), "{to}: names are not as they were written: {error}");
        assert_eq!(error.line, Some(line), "{to}: {error}");
        assert!(error.reason.contains(says) && error.to_string().contains(&format!("line {line}: ")), "{to}: {error}");
    }
}

#[test]
fn a_function_that_is_missing_is_named() {
    let Verdict::Bad(error) = verdict("fn density_bound(", "fn density_bounds(") else { panic!("passes") };
    assert_eq!(error.to_string(), "the model does not compile: there is no function density_bound");
}

#[test]
fn what_is_not_loaded_is_waited_for() {
    let import = "import bevy_cumulus::{";
    let source = GOOD.replace(import, &format!("import my_game::torus::ring;\n{import}"));
    let source = source.replace("return 1.0", "return ring()");
    assert_eq!(check(&source, std::iter::empty()), Verdict::Waits);
    let torus = Shader::from_wesl("fn ring() -> f32 { return 2.0; }", "embedded://my_game/torus.wesl");
    assert_eq!(check(&source, [(place(99), &torus)].into_iter()), Verdict::Good);
}
