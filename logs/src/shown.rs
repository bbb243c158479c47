//! Names, times and values as people are shown them.

use std::fmt;

/// A text of somebody else's: what would move the cursor, hide letters or turn their order is
/// escaped, as in `\u{1b}`.
pub(crate) struct Shown<'a>(pub(crate) &'a str);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.0.chars().any(is_hidden) {
            return f.pad(self.0);
        }
        f.pad(&escaped(self.0))
    }
}

/// A text of somebody else's without letters that a terminal would obey: what would move the
/// cursor, hide letters or turn their order is escaped.
///
/// ```
/// assert_eq!(farside_logs::escaped("/a\u{1b}[2J"), "/a\\u{1b}[2J");
/// ```
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        if is_hidden(letter) {
            out.extend(letter.escape_default());
        } else {
            out.push(letter);
        }
    }
    out
}

/// True for control characters, line separators, and what turns the direction of writing.
///
/// ```
/// assert!(farside_logs::is_hidden('\u{9b}') && !farside_logs::is_hidden('ö'));
/// ```
pub fn is_hidden(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}')
        || matches!(letter, '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// Nanoseconds as seconds, with every digit.
pub(crate) struct Seconds(pub(crate) u64);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}.{:09}",
            self.0 / 1_000_000_000,
            self.0 % 1_000_000_000
        )
    }
}

/// How many letters of a value are shown.
pub(crate) const SHOWN: usize = 120;

/// The first letters of a text.
pub(crate) fn shorten(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text.to_owned(),
    }
}

/// Letters in front of the first difference that are shown.
const LEAD: usize = 20;

/// Two different texts, so that the difference shows: long ones from shortly in front of it.
pub(crate) fn apart(a: &str, b: &str) -> (String, String) {
    let first = a.bytes().zip(b.bytes()).position(|(x, y)| x != y);
    let mut at = first.unwrap_or(a.len().min(b.len()));
    while !a.is_char_boundary(at) || !b.is_char_boundary(at) {
        at -= 1;
    }
    let lead = a[..at].char_indices().rev().take(LEAD).last();
    let lead = lead.map_or(at, |(lead, _)| lead);
    let length = |text: &str| text.char_indices().nth(SHOWN).is_some();
    if !(length(a) || length(b)) || lead == 0 {
        let (x, y) = (shorten(a), shorten(b));
        if x != y {
            return (x, y);
        }
    }
    let tail = |text: &str| {
        let shown = shorten(&text[lead..]);
        format!("{} bytes, from byte {lead}: {shown:?}", text.len())
    };
    (tail(a), tail(b))
}

/// Bytes as two digits each.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_escaped() {
        assert_eq!(
            Shown("/a\n\u{1b}[2J\u{202e}b").to_string(),
            "/a\\n\\u{1b}[2J\\u{202e}b"
        );
        assert_eq!(Shown("/größe").to_string(), "/größe");
    }

    #[test]
    fn long_texts_are_shown_where_they_differ() {
        let long = "é".repeat(500);
        let (a, b) = apart(&format!("{long}x{long}"), &format!("{long}y"));
        assert_ne!(a, b);
        assert!(a.contains("éx") && b.contains("éy\""), "{a} | {b}");
        assert_eq!(apart("ab", "ac"), ("ab".to_owned(), "ac".to_owned()));
        let (a, b) = apart(&long, &format!("{long}z"));
        assert!(a != b, "{a} | {b}");
    }

    #[test]
    fn seconds_have_nine_digits() {
        assert_eq!(
            Seconds(1_700_000_000_123_456_790).to_string(),
            "1700000000.123456790"
        );
    }
}
