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
    for import in imports {
        let Some((_, names)) = import.split_once("::model::").filter(|(start, _)| !start.contains('{')) else {
            continue;
        };
        let mut depth = 0;
        let mut word = String::new();
        let outer = usize::from(names.starts_with('{'));
        for c in names.chars() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ':' if depth == outer && !word.is_empty() => found.push(std::mem::take(&mut word)),
                ',' => word.clear(),
                c if c.is_alphanumeric() || c == '_' => {
                    if depth == outer {
                        word.push(c);
                    }
                }
                _ => {}
            }
            if outer == 0 && !found.is_empty() {
                break;
            }
        }
    }
    found
}

#[test]
fn imports_are_found_however_they_are_written() {
    let text =
        "import package::model::{medium::{Medium, MOST_DECKS}, planet::altitude};\nimport package::model::data::model;
        import package::render::{frame::frame, model::x};";
    assert_eq!(modules_of_the_model(text), ["medium", "planet", "data"]);
}
