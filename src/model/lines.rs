//! From a place in composed WGSL back to the line of the module that it came from.
//!
//! The composer prints a module's declarations anew, under longer names and without comments. But it keeps their tokens and
//! their order, so the n-th token of a declaration is the n-th there, too.

/// How the composer begins the names of what the model's module declares.
const MODEL: &str = "model_model_";
/// What a declaration begins with.
const KEYWORDS: [&str; 6] = ["fn", "struct", "const", "var", "alias", "override"];

/// A word, a number, or a sign, and where it stands.
struct Token<'a> {
    at: usize,
    text: &'a str,
}

/// A declaration: its name, and its tokens.
struct Declared<'a> {
    name: &'a str,
    tokens: &'a [Token<'a>],
}

/// Whether the source declares something of this name.
pub(super) fn declares(source: &str, name: &str) -> bool {
    of(source, name).is_some()
}

/// Line, from 1, of the declaration of this name.
pub(super) fn of(source: &str, name: &str) -> Option<usize> {
    let tokens = tokens(source);
    let found = declarations(&tokens).into_iter().find(|declared| declared.name == name)?;
    Some(line_of(source, found.tokens.first()?.at))
}

/// Line of the first such word, in the declaration of this name if there is one.
pub(super) fn of_word(source: &str, word: &str, declared: Option<&str>) -> Option<usize> {
    let all = tokens(source);
    let declarations = declarations(&all);
    let within = declarations.iter().find(|known| Some(known.name) == declared).map_or(&*all, |known| known.tokens);
    Some(line_of(source, within.iter().find(|token| token.text == word)?.at))
}

/// Line of the source whose token stands at `at` in the composed text, if the model's module declares what is there.
pub(super) fn in_source(source: &str, composed: &str, at: usize) -> Option<usize> {
    let (own, all) = (tokens(source), tokens(composed));
    let there = declarations(&all).into_iter().rfind(|declared| declared.tokens.first().is_some_and(|t| t.at <= at))?;
    let name = |declared: &Declared| there.name.ends_with(&format!("{MODEL}{}", mangled(declared.name)));
    let here = declarations(&own).into_iter().find(name)?;
    let n = there.tokens.iter().take_while(|token| token.at <= at).count().max(1) - 1;
    let token = here.tokens.get(n).or(here.tokens.last())?;
    Some(line_of(source, token.at))
}

/// Line that a message names as `path:line`.
pub(super) fn named(message: &str, path: &str) -> Option<usize> {
    let (_, rest) = message.split_once(&format!("{path}:"))?;
    rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

fn line_of(text: &str, at: usize) -> usize {
    text[..at].lines().count().max(1) + usize::from(text[..at].ends_with('\n'))
}

/// As the composer writes an item's name: with the number of its underscores before it, if it has any.
fn mangled(name: &str) -> String {
    match name.matches('_').count() {
        0 => name.to_owned(),
        n => format!("_{n}{name}"),
    }
}

fn declarations<'a>(tokens: &'a [Token<'a>]) -> Vec<Declared<'a>> {
    let mut starts = Vec::new();
    let mut depth = 0_i32;
    for (i, token) in tokens.iter().enumerate() {
        match token.text {
            "{" => depth += 1,
            "}" => depth -= 1,
            word if depth == 0 && KEYWORDS.contains(&word) => starts.push(i),
            _ => {}
        }
    }
    let ends = starts.iter().skip(1).copied().chain([tokens.len()]);
    let of = |(start, end): (usize, usize)| {
        let tokens = &tokens[start..end];
        // `var<storage, read> name`: the name is behind the brackets.
        let skip = if tokens.get(1)?.text == "<" { tokens.iter().position(|t| t.text == ">")? + 1 } else { 1 };
        Some(Declared { name: tokens.get(skip)?.text, tokens })
    };
    starts.iter().copied().zip(ends).filter_map(of).collect()
}

/// All tokens but brackets, commas and semicolons, which the composer may add or leave out. A path is one.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut all = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            rest.find("*/").map_or(rest.len(), |end| end + 2)
        } else if c.is_ascii_digit() || c == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit()) {
            number(rest)
        } else if c.is_alphanumeric() || c == '_' {
            path(rest)
        } else {
            c.len_utf8()
        };
        let token = &rest[..length];
        if !c.is_whitespace() && !token.starts_with("//") && !token.starts_with("/*") && !"(),;".contains(c) {
            all.push(Token { at, text: token });
        }
        at += length;
    }
    all
}

/// Length of the number that the text begins with, its exponent's sign included.
fn number(text: &str) -> usize {
    let hexadecimal = text.starts_with("0x") || text.starts_with("0X");
    let mut before = ' ';
    let inside = |c: char| {
        let sign = (c == '+' || c == '-') && matches!(before, 'e' | 'E') && !hexadecimal;
        before = c;
        sign || c == '.' || c.is_ascii_alphanumeric()
    };
    let mut inside = inside;
    text.find(|c| !inside(c)).unwrap_or(text.len())
}

/// Length of the word that the text begins with, and of all that `::` joins to it.
fn path(text: &str) -> usize {
    let word = |text: &str| text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    let mut length = word(text);
    while let Some(rest) = text[length..].strip_prefix("::") {
        length += 2 + word(rest);
    }
    length
}
