//! The seam between modelling and rendering: neither side reaches past it.

use std::path::Path;

/// Every `.rs` and `.wesl` file below a folder, with its text.
fn sources(folder: &Path) -> Vec<(String, String)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("the folder is there") {
        let path = entry.expect("it can be read").path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs" || e == "wesl") {
            let text = std::fs::read_to_string(&path).expect("a source is text");
            found.push((path.display().to_string(), text));
        }
    }
    found
}

#[test]
fn the_model_knows_nothing_of_the_renderer() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let model = sources(&root.join("model"));
    assert!(model.len() >= 6, "only {} files of the model", model.len());
    for (path, text) in &model {
        for forbidden in ["crate::render", "super::render", "package::render", "bevy_cumulus::render", "bevy_pbr"] {
            assert!(!text.contains(forbidden), "{path} mentions {forbidden}");
        }
    }
    // And the renderer's shaders import of the model what its contract is in, and the planet it stands on.
    for (path, text) in sources(&root.join("render")).iter().filter(|(path, _)| path.ends_with(".wesl")) {
        assert!(!text.contains("@group(1)"), "{path} binds the model's group");
        for module in modules_of_the_model(text) {
            let known = ["medium", "model", "planet"];
            assert!(known.contains(&module.as_str()), "{path} imports the model's module {module}");
        }
    }
}

/// The modules `a`, `b` of `import package::model::{a::X, b::{Y, Z}};`, and `a` of `import package::model::a::X;`.
fn modules_of_the_model(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let imports = text.split("import ").skip(1).filter_map(|rest| rest.split(';').next());
    for names in imports.filter_map(|import| import.trim_start().strip_prefix("package::model::")) {
        if !names.starts_with('{') {
            found.extend(names.split("::").next().map(str::to_owned));
            continue;
        }
        // Outermost in the braces; deeper names are a module's own.
        let mut depth = 0;
        for part in names.split_inclusive(['{', '}', ',']) {
            if depth == 1 {
                found.extend(part.split("::").next().map(|module| module.trim().to_owned()));
            }
            match part.chars().last() {
                Some('{') => depth += 1,
                Some('}') => depth -= 1,
                _ => {}
            }
        }
    }
    found.retain(|module| module.chars().any(char::is_alphabetic));
    found
}

#[test]
fn imports_are_found_however_they_are_written() {
    let text =
        "import package::model::{medium::{Medium, MOST_DECKS}, planet::altitude};\nimport package::model::data::model;
        import package::render::{frame::frame, model::x};";
    assert_eq!(modules_of_the_model(text), ["medium", "planet", "data"]);
}
