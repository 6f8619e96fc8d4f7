//! What a report says, as the parser library understands it.

use metar::{ErrorVariant, Metar};

use super::MetarError;

/// Groups that are read, with the place of each in the report.
struct Groups(Vec<(usize, String)>);

/// Parses the observation in `line`.
///
/// Only what is used is given to the library: what comes after the pressure (recent weather, runways, trends, remarks) differs
/// from country to country and would fail good reports.
pub(super) fn parse(line: &str) -> Result<Metar, MetarError> {
    let groups = Groups::of(line)?;
    let text = groups.text();
    Metar::parse(&text).map_err(|errors| match errors.first() {
        Some(error) => groups.error(error.start, &error.variant),
        None => MetarError::Ends(String::new()),
    })
}

impl Groups {
    fn of(line: &str) -> Result<Self, MetarError> {
        let mut kept: Vec<(usize, String)> = Vec::new();
        for (number, word) in (1..).zip(line.split_whitespace()) {
            let (group, last) = match word.strip_suffix('=') {
                Some(before) => (before.to_ascii_uppercase(), true),
                None => (word.to_ascii_uppercase(), false),
            };
            if !group.is_ascii() {
                let problem = "it has letters that no METAR report has".to_owned();
                return Err(MetarError::Group { group, number, problem });
            }
            if group == "NIL" {
                return Err(MetarError::Nil);
            }
            if matches!(group.as_str(), "RMK" | "TEMPO" | "BECMG" | "NOSIG") {
                break;
            }
            let pressure = is_pressure(&group);
            if !is_left_out(&group, &kept) {
                kept.push((number, plain_visibility(group)));
            }
            if pressure || last {
                break;
            }
        }
        if kept.is_empty() { Err(MetarError::Empty) } else { Ok(Self(kept)) }
    }

    fn text(&self) -> String {
        self.0.iter().map(|(_, group)| group.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// The group that the library stopped at: `at` is a place in [`text`](Self::text).
    fn error(&self, at: usize, variant: &ErrorVariant) -> MetarError {
        let mut from = 0;
        for (number, group) in &self.0 {
            // The blank after a group belongs to it: there it proved too short.
            let is_last = from + group.len() == self.text().len();
            if at <= from + group.len() || is_last {
                // After no more than station and time something is missing, rather than wrong.
                if is_last && at >= from + group.len() && self.0.len() < 3 {
                    return MetarError::Ends(group.clone());
                }
                return MetarError::Group { group: group.clone(), number: *number, problem: problem(variant) };
            }
            from += group.len() + 1;
        }
        MetarError::Empty
    }
}

fn problem(variant: &ErrorVariant) -> String {
    match variant {
        // The library lists single letters that might go on, which tells nobody anything.
        ErrorVariant::ExpectedFound { .. } => "no group that can stand here is written so".to_owned(),
        other => other.to_string(),
    }
}

fn digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// Q1013, A2992, or unknown.
fn is_pressure(group: &str) -> bool {
    matches!(group.split_at_checked(1), Some(("Q" | "A", rest)) if rest.len() == 4 && (digits(rest) || rest == "////"))
}

/// What says nothing about the sky: kind of report, directions that the wind varies between, runways' visual range, a second
/// visibility, and slashes for weather that an automatic station cannot see.
fn is_left_out(group: &str, before: &[(usize, String)]) -> bool {
    if before.is_empty() && matches!(group, "METAR" | "SPECI") {
        return true;
    }
    let varying = group.len() == 7 && group.as_bytes()[3] == b'V';
    let runway = group.starts_with('R') && group.contains('/') && group[1..].starts_with(|c: char| c.is_ascii_digit());
    let directions = ["", "N", "NE", "E", "SE", "S", "SW", "W", "NW", "NDV"];
    let is_metres = |group: &str| group.split_at_checked(4).is_some_and(|(n, d)| digits(n) && directions.contains(&d));
    let second = is_metres(group) && before.last().is_some_and(|(_, earlier)| is_metres(earlier));
    varying || runway || second || group == "//" || group == "$"
}

/// `P6SM`, more than 6 miles, and `M1/4SM`, less than a quarter: the number alone. `20KM`: metres.
fn plain_visibility(group: String) -> String {
    if let Some(kilometres) = group.strip_suffix("KM").and_then(|number| number.parse::<u32>().ok()) {
        return format!("{:04}", kilometres.saturating_mul(1000).min(9999));
    }
    let bare = group.strip_suffix("SM").and_then(|_| group.strip_prefix(['P', 'M']));
    bare.filter(|bare| bare.starts_with(|c: char| c.is_ascii_digit())).map(str::to_owned).unwrap_or(group)
}
