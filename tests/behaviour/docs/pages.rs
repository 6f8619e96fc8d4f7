//! Links and pictures of the pages.

use super::{root, texts};

const PAGES: [&str; 4] = ["README.md", "CHANGELOG.md", "CREDITS.md", "docs"];

/// What a page links to or shows: `](target)` and `src="target"`.
fn targets(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut is_code = false;
    for line in text.lines() {
        is_code ^= line.starts_with("```");
        if is_code {
            continue;
        }
        for (opens, closes) in [("](", ')'), ("src=\"", '"')] {
            found.extend(line.split(opens).skip(1).filter_map(|rest| rest.split(closes).next()));
        }
    }
    found
}

/// A heading's anchor, as it is made from its words.
fn anchor(heading: &str) -> String {
    let words = heading.trim_start_matches('#').trim().to_lowercase();
    words.chars().filter(|c| c.is_alphanumeric() || *c == '-' || *c == ' ').collect::<String>().replace(' ', "-")
}

#[test]
fn every_link_leads_somewhere() {
    let mut links = 0;
    for (path, text) in texts(&PAGES, &["md"]) {
        for target in targets(&text).into_iter().filter(|target| !target.contains("://")) {
            links += 1;
            let (file, section) =
                target.split_once('#').map_or((target, None), |(file, section)| (file, Some(section)));
            let there = if file.is_empty() { path.clone() } else { path.with_file_name("").join(file) };
            assert!(there.exists(), "{}: there is no {target}", path.display());
            let Some(section) = section else { continue };
            let page = std::fs::read_to_string(&there).unwrap_or_else(|error| panic!("{}: {error}", there.display()));
            let mut headings = page.lines().filter(|line| line.starts_with('#'));
            assert!(headings.any(|line| anchor(line) == section), "{}: {target} has no such heading", path.display());
        }
    }
    assert!(links > 100, "only {links} links");
}

#[test]
fn only_what_belongs_there_stands_at_the_root() {
    let entries = std::fs::read_dir(root()).expect("the root can be read");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut pages: Vec<String> = names.filter(|name| name.ends_with(".md")).collect();
    pages.sort();
    assert_eq!(pages, ["CHANGELOG.md", "CREDITS.md", "README.md"]);
    let readme = std::fs::read_to_string(root().join("README.md")).expect("the page is there");
    assert!(readme.lines().count() <= 130, "README.md is {} lines long: move some to docs/", readme.lines().count());
}
