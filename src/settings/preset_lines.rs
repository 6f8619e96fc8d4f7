//! Where fields stand in the text of a preset: RON, read no further than names, nesting, comments and strings.

/// Deeper than this, what is written is not a preset.
const DEEPEST: usize = 32;

/// A field, or an item of a list or tuple, in a text.
#[derive(Clone, PartialEq, Debug)]
struct Place {
    /// Its path, such as `layers.0.map.cover`.
    path: String,
    /// Where it begins: its name, if it has one (bytes).
    start: usize,
    /// Where it ends (bytes); at the end of the text where it is not closed.
    end: usize,
}

/// The fields of a text, in its order.
pub(super) struct Places<'a> {
    text: &'a str,
    all: Vec<Place>,
}

impl<'a> Places<'a> {
    pub fn of(text: &'a str) -> Self {
        Self { text, all: Walk::through(text) }
    }

    /// Where the field at this path begins (bytes), if it is written.
    pub fn find(&self, path: &str) -> Option<usize> {
        let at = |path: &str| self.all.iter().find(|place| place.path == path).map(|place| place.start);
        at(path).or_else(|| {
            // The text has vectors as tuples.
            let (parent, axis) = path.rsplit_once('.')?;
            let index = ["x", "y", "z"].iter().position(|name| *name == axis)?;
            at(&format!("{parent}.{index}"))
        })
    }

    /// Where the field at this path begins (bytes), or the innermost around it that is written.
    pub fn nearest(&self, path: &str) -> usize {
        let mut path = path;
        loop {
            if let Some(start) = self.find(path) {
                return start;
            }
            match path.rsplit_once('.') {
                Some((parent, _)) => path = parent,
                None => return skip_space(self.text, 0),
            }
        }
    }

    /// Path of the innermost field around this place (bytes).
    pub fn around(&self, offset: usize) -> Option<&str> {
        let inside = |place: &&Place| (place.start..=place.end).contains(&offset);
        self.all.iter().rev().find(inside).map(|place| &*place.path)
    }
}

/// Line and column of a place (bytes), both from 1; columns count characters.
pub(super) fn line_and_column(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// The place of a line and column (bytes).
pub(super) fn offset(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let rest = &text[start..];
    start + rest.char_indices().nth(column.saturating_sub(1)).map_or(rest.len(), |(at, _)| at)
}

/// Past white space and comments.
pub(super) fn skip_space(text: &str, from: usize) -> usize {
    let mut rest = &text[from..];
    loop {
        rest = rest.trim_start();
        if rest.starts_with("//") {
            rest = rest.find('\n').map_or("", |end| &rest[end..]);
        } else if rest.starts_with("/*") {
            rest = after_block_comment(rest);
        } else {
            return text.len() - rest.len();
        }
    }
}

/// Block comments may hold others.
fn after_block_comment(text: &str) -> &str {
    let (mut rest, mut depth) = (text, 0_usize);
    while let Some(at) = rest.find("/*").into_iter().chain(rest.find("*/")).min() {
        depth = if rest[at..].starts_with("/*") { depth + 1 } else { depth - 1 };
        rest = &rest[at + 2..];
        if depth == 0 {
            return rest;
        }
    }
    ""
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Token {
    Open,
    Close,
    Comma,
    Colon,
    /// A name, number or keyword.
    Word,
    /// A string, a character, an attribute, or what does not belong in a preset.
    Other,
}

/// The next token from here on, with its start and end (bytes).
fn next_token(text: &str, from: usize) -> Option<(Token, usize, usize)> {
    let start = skip_space(text, from);
    let rest = &text[start..];
    let first = rest.chars().next()?;
    let (token, length) = match first {
        '(' | '[' | '{' => (Token::Open, 1),
        ')' | ']' | '}' => (Token::Close, 1),
        ',' => (Token::Comma, 1),
        ':' => (Token::Colon, 1),
        '#' if rest.starts_with("#!") => (Token::Other, rest.find(']').map_or(rest.len(), |end| end + 1)),
        '\'' => (Token::Other, character(rest)),
        _ => match string(rest) {
            Some(length) => (Token::Other, length),
            None if is_word(first) => (Token::Word, rest.find(|c| !is_word(c)).unwrap_or(rest.len())),
            None => (Token::Other, first.len_utf8()),
        },
    };
    Some((token, start, start + length))
}

/// Names, `r#names` and numbers.
fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '+' | '-' | '#')
}

/// Length of the character in quotes that the text begins with; of the quote alone where there is none.
fn character(text: &str) -> usize {
    let mut inside = text.char_indices().skip(1);
    match inside.next() {
        Some((_, '\\')) => inside.skip(1).find(|(_, c)| *c == '\'').map_or(1, |(at, _)| at + 1),
        _ => inside.next().filter(|(_, c)| *c == '\'').map_or(1, |(at, _)| at + 1),
    }
}

/// Length of the string that the text begins with, if it does: plain, raw or of bytes.
fn string(text: &str) -> Option<usize> {
    let rest = text.strip_prefix('b').unwrap_or(text);
    let (body, length) = if let Some(raw) = rest.strip_prefix('r') {
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        let body = raw[hashes..].strip_prefix('"')?;
        let close = format!("\"{}", "#".repeat(hashes));
        (body, body.find(&close).map(|at| at + close.len()))
    } else {
        let body = rest.strip_prefix('"')?;
        let mut escaped = false;
        let close = body.find(|c| {
            let closes = c == '"' && !escaped;
            escaped = c == '\\' && !escaped;
            closes
        });
        (body, close.map(|at| at + 1))
    };
    Some(text.len() - body.len() + length.unwrap_or(body.len()))
}

/// What stands between two brackets.
#[derive(Default)]
struct Level {
    path: String,
    /// Items so far.
    items: usize,
    /// The field or item being read, by its place in the list.
    current: Option<usize>,
    /// `Some(…)`, which has no part in paths.
    is_wrapper: bool,
}

/// A walk through the text.
struct Walk {
    all: Vec<Place>,
    levels: Vec<Level>,
}

impl Walk {
    fn through(text: &str) -> Vec<Place> {
        let mut walk = Self { all: Vec::new(), levels: vec![Level::default()] };
        let (mut from, mut is_wrapper) = (0, false);
        while let Some((token, start, end)) = next_token(text, from) {
            from = end;
            let word = &text[start..end];
            match token {
                Token::Word => match next_token(text, end) {
                    Some((Token::Colon, _, after)) => {
                        walk.finish(start);
                        walk.begin(word.strip_prefix("r#").unwrap_or(word), start);
                        from = after;
                    }
                    _ => walk.begin_item(start),
                },
                Token::Other => walk.begin_item(start),
                Token::Open => {
                    walk.begin_item(start);
                    walk.open(is_wrapper);
                }
                Token::Close => walk.close(start),
                Token::Comma => walk.next_item(start),
                Token::Colon => {}
            }
            is_wrapper = word == "Some";
        }
        for place in walk.all.iter_mut().filter(|place| place.end == usize::MAX) {
            place.end = text.len();
        }
        walk.all
    }

    fn begin(&mut self, name: &str, start: usize) {
        let depth = self.levels.len();
        let Some(level) = self.levels.last_mut().filter(|_| depth <= DEEPEST) else { return };
        let path = if level.path.is_empty() { name.to_owned() } else { format!("{}.{name}", level.path) };
        level.current = Some(self.all.len());
        self.all.push(Place { path, start, end: usize::MAX });
    }

    /// Begins an item that has no name, unless it is the value of a field.
    fn begin_item(&mut self, start: usize) {
        let Some(level) = self.levels.last() else { return };
        if self.levels.len() > 1 && level.current.is_none() && !level.is_wrapper {
            self.begin(&level.items.to_string(), start);
        }
    }

    fn open(&mut self, is_wrapper: bool) {
        let Some(level) = self.levels.last() else { return };
        let path = level.current.map_or_else(|| level.path.clone(), |current| self.all[current].path.clone());
        self.levels.push(Level { path, is_wrapper, ..Level::default() });
    }

    fn finish(&mut self, end: usize) {
        if let Some(current) = self.levels.last_mut().and_then(|level| level.current.take()) {
            self.all[current].end = end;
        }
    }

    fn next_item(&mut self, end: usize) {
        self.finish(end);
        if let Some(level) = self.levels.last_mut() {
            level.items += 1;
        }
    }

    fn close(&mut self, end: usize) {
        self.finish(end);
        // A bracket too many closes nothing.
        if self.levels.len() > 1 {
            self.levels.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r##"// layers: not here
(
    model: (enabled: false), /* lighting: /* nor */ here */
    layers: [
        (name: "a, (b: [\"c", base: 900.0),
        (
            map: (
                cover: 3.5, seed: 7),
            albedo: (0.5, 0.6,
                0.7), r#base: 1, kind: Sheet,
        ),
    ],
    text: r#"raw " (coverage: 1"#, letter: '(', quote: '\'',
    sun_elevation: Some(
        24.0),
    wrapped: Some((inside: 1)),
)"##;

    fn found(path: &str) -> Option<(usize, usize)> {
        Places::of(TEXT).find(path).map(|at| line_and_column(TEXT, at))
    }

    #[test]
    fn fields_are_found_by_path() {
        for (path, place) in [
            ("model", (3, 5)),
            ("model.enabled", (3, 13)),
            ("layers", (4, 5)),
            ("layers.0", (5, 9)),
            ("layers.0.base", (5, 31)),
            ("layers.1", (6, 9)),
            ("layers.1.map.cover", (8, 17)),
            ("layers.1.map.seed", (8, 29)),
            ("layers.1.albedo.y", (9, 27)),
            ("layers.1.albedo.2", (10, 17)),
            ("layers.1.base", (10, 23)),
            ("layers.1.kind", (10, 34)),
            ("text", (13, 5)),
            ("letter", (13, 36)),
            ("quote", (13, 49)),
            ("sun_elevation", (14, 5)),
            ("wrapped.inside", (16, 20)),
        ] {
            assert_eq!(found(path), Some(place), "{path}");
        }
        for path in ["lighting", "b", "coverage", "layers.2", "layers.0.b", "model.coverage", "sun_elevation.0"] {
            assert_eq!(found(path), None, "{path}");
        }
    }

    #[test]
    fn what_is_not_written_is_found_by_what_is_around_it() {
        let places = Places::of(TEXT);
        for (path, place) in [("layers.1.map.scale", (7, 13)), ("layers.0.top", (5, 9)), ("lighting.octaves", (2, 1))] {
            assert_eq!(line_and_column(TEXT, places.nearest(path)), place, "{path}");
        }
    }

    #[test]
    fn places_belong_to_the_innermost_field() {
        let places = Places::of(TEXT);
        for (line, column, path) in [
            (3, 22, Some("model.enabled")),
            (5, 10, Some("layers.0.name")),
            (5, 33, Some("layers.0.base")),
            (8, 24, Some("layers.1.map.cover")),
            (10, 18, Some("layers.1.albedo.2")),
            (12, 5, Some("layers")),
            (15, 10, Some("sun_elevation")),
            (1, 5, None),
            (17, 2, None),
        ] {
            assert_eq!(places.around(offset(TEXT, line, column)), path, "{line}:{column}");
        }
    }

    #[test]
    fn broken_text_is_walked_to_its_end() {
        let open = "(\n  model: (\n    coverage: 0.5";
        assert_eq!(Places::of(open).around(open.len()), Some("model.coverage"));
        let no_comma = "(model: (coverage: 0.5) lighting: (octaves: 2))";
        assert_eq!(Places::of(no_comma).around(26), Some("lighting"));
        assert_eq!(Places::of(")]}(a: 1").find("a"), Some(4));
        for text in ["", "(", "\"", "r#\"", "'", "'\\", "/*", "//", "#![", "(a:", "é: ü", "r###", "b", "*/"] {
            assert_eq!(Places::of(text).nearest("model.coverage"), skip_space(text, 0), "{text}");
        }
        // Neither the stack nor memory runs out.
        let deep = "(a:[".repeat(100_000);
        assert!(Places::of(&deep).all.len() <= DEEPEST);
    }

    #[test]
    fn lines_and_columns_count_characters() {
        let text = "é\nüb c\n";
        for (line, column, at) in [(1, 1, 0), (1, 2, 2), (2, 1, 3), (2, 3, 6), (3, 1, 9)] {
            assert_eq!(offset(text, line, column), at, "{line}:{column}");
            assert_eq!(line_and_column(text, at), (line, column));
        }
        assert_eq!(offset(text, 9, 9), text.len());
    }
}
