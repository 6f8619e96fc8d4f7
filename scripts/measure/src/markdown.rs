//! Tables in Markdown.

use std::fmt::Write as _;

/// A table from its head and rows; every column but the first is aligned to the right.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let mut text = format!("| {} |\n|---|{}\n", head.join(" | "), "--:|".repeat(head.len().saturating_sub(1)));
    for row in rows {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// A number with about three digits that count.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "–".to_owned()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 0.0995 {
        format!("{value:.2}")
    } else if size >= 0.00005 {
        format!("{value:.4}")
    } else {
        "0".to_owned()
    }
}

/// The same, or a dash.
pub fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), number)
}

/// What a zoom means for the pictures, as part of a sentence.
pub fn zoomed(zoom: f64) -> String {
    if zoom == 1.0 { String::new() } else { format!(" (the middle of each view, {zoom} times larger)") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_about_three_digits() {
        let all = [1558.0, 34.61, 6.5, 0.123, 0.0567, 0.0, 0.00001].map(number);
        assert_eq!(all, ["1558", "34.6", "6.50", "0.12", "0.0567", "0", "0"]);
        assert_eq!(maybe(None), "–");
    }

    #[test]
    fn tables_have_a_line_below_the_head() {
        assert_eq!(table(&["a", "b"], &[vec!["1".into(), "2".into()]]), "| a | b |\n|---|--:|\n| 1 | 2 |\n");
    }
}
