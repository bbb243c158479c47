//! Two JSON documents, value by value.
//!
//! Numbers are kept as they are written: integers of any size are compared digit by digit. `1`,
//! `1.0` and `1e0` are one number; `null` is something else than nothing; of keys that are there
//! twice, the first is compared with the first.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{DEPTH, FieldDiff, Path, near, raw};
use crate::shown::{SHOWN, apart, shorten};

/// A JSON value, borrowed from its text.
enum Json<'a> {
    Null,
    Bool(bool),
    Number(&'a str),
    Text(Cow<'a, str>),
    Array(Vec<Json<'a>>),
    Object(Vec<(Cow<'a, str>, Json<'a>)>),
}

/// The first place in which two JSON documents differ. Where one is no JSON, the first byte.
pub(crate) fn json(a: &[u8], b: &[u8], tolerance: f64) -> Option<FieldDiff> {
    if a == b {
        return None;
    }
    match (parse(a), parse(b)) {
        (Ok(x), Ok(y)) => values(&Path::Root("data"), &x, &y, tolerance),
        (Err(why), _) | (_, Err(why)) => Some(raw("data", a, b).because(why)),
    }
}

fn values(path: &Path<'_>, a: &Json<'_>, b: &Json<'_>, tolerance: f64) -> Option<FieldDiff> {
    let same = match (a, b) {
        (Json::Null, Json::Null) => true,
        (Json::Bool(x), Json::Bool(y)) => x == y,
        (Json::Number(x), Json::Number(y)) => numbers(x, y, tolerance),
        (Json::Text(x), Json::Text(y)) => {
            return (x != y).then(|| {
                let (a, b) = apart(x, y);
                FieldDiff::new(path.to_string(), format!("{a:?}"), format!("{b:?}"))
            });
        }
        (Json::Array(x), Json::Array(y)) => {
            let mut pairs = x.iter().zip(y).enumerate();
            let found =
                pairs.find_map(|(at, (x, y))| values(&Path::Entry(path, &at), x, y, tolerance));
            return found.or_else(|| {
                let length = || format!("{path}.length");
                (x.len() != y.len()).then(|| FieldDiff::new(length(), x.len(), y.len()))
            });
        }
        (Json::Object(x), Json::Object(y)) => return objects(path, x, y, tolerance),
        _ => false,
    };
    (!same).then(|| {
        let (x, y) = (show(a), show(b));
        FieldDiff::new(path.to_string(), x, y)
    })
}

type Entries<'a> = [(Cow<'a, str>, Json<'a>)];

fn objects(path: &Path<'_>, x: &Entries<'_>, y: &Entries<'_>, tolerance: f64) -> Option<FieldDiff> {
    let mut keys: BTreeMap<(&str, usize), [Option<&Json<'_>>; 2]> = BTreeMap::new();
    for (side, entries) in [x, y].into_iter().enumerate() {
        let mut times: BTreeMap<&str, usize> = BTreeMap::new();
        for (key, value) in entries {
            let time = times.entry(key).or_default();
            keys.entry((key, *time)).or_default()[side] = Some(value);
            *time += 1;
        }
    }
    keys.into_iter().find_map(|((key, _), both)| {
        let path = Path::Field(path, key);
        match both {
            [Some(x), Some(y)] => values(&path, x, y, tolerance),
            [x, y] => {
                let text = |value: Option<&Json<'_>>| value.map_or("absent".to_owned(), show);
                Some(FieldDiff::new(path.to_string(), text(x), text(y)))
            }
        }
    })
}

/// True if two numbers are the same or differ by no more than the tolerance.
fn numbers(a: &str, b: &str, tolerance: f64) -> bool {
    if a == b {
        return true;
    }
    if let (Some(x), Some(y)) = (decimal(a), decimal(b))
        && x == y
    {
        return true;
    }
    let read = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
    match (read(a), read(b)) {
        // Without a tolerance, digits decide: there are more of them than a float holds.
        (Some(x), Some(y)) if tolerance > 0.0 => near(x, y, tolerance),
        _ => false,
    }
}

/// A number's sign, its digits without zeros around them, and the power of ten of the last one.
fn decimal(text: &str) -> Option<(bool, String, i64)> {
    let (negative, text) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, exponent.parse::<i64>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let all = format!("{whole}{part}");
    let all = all.trim_start_matches('0');
    let kept = all.trim_end_matches('0');
    if kept.is_empty() {
        return Some((negative, String::new(), 0));
    }
    let dropped = (all.len() - kept.len()) as i64;
    let exponent = exponent.checked_add(dropped)?;
    Some((
        negative,
        kept.to_owned(),
        exponent.checked_sub(part.len() as i64)?,
    ))
}

fn show(value: &Json<'_>) -> String {
    let mut out = String::new();
    write(value, &mut out);
    shorten(&out)
}

/// Appends a value, until there is enough to be shown.
fn write(value: &Json<'_>, out: &mut String) {
    match value {
        Json::Null => out.push_str("null"),
        Json::Bool(value) => out.push_str(if *value { "true" } else { "false" }),
        Json::Number(text) => out.push_str(text),
        Json::Text(text) => out.push_str(&format!("{:?}", shorten(text))),
        Json::Array(values) => {
            out.push('[');
            for (at, value) in values.iter().enumerate().take_while(|(at, _)| *at < SHOWN) {
                if out.len() > SHOWN {
                    break;
                }
                out.push_str(if at == 0 { "" } else { "," });
                write(value, out);
            }
            out.push(']');
        }
        Json::Object(entries) => {
            out.push('{');
            for (at, (key, value)) in entries.iter().enumerate() {
                if out.len() > SHOWN {
                    break;
                }
                out.push_str(if at == 0 { "" } else { "," });
                out.push_str(&format!("{:?}:", shorten(key)));
                write(value, out);
            }
            out.push('}');
        }
    }
}

fn parse(bytes: &[u8]) -> Result<Json<'_>, &'static str> {
    let text = std::str::from_utf8(bytes).map_err(|_| "JSON that is not UTF-8")?;
    let mut parser = Parser { text, at: 0 };
    let value = parser.value(0)?;
    parser.space();
    match parser.at == text.len() {
        true => Ok(value),
        false => Err(MALFORMED),
    }
}

const MALFORMED: &str = "bytes that are no JSON";

struct Parser<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\n' | b'\r')) {
            self.at += 1;
        }
    }

    fn takes(&mut self, byte: u8) -> bool {
        self.space();
        let takes = self.peek() == Some(byte);
        self.at += usize::from(takes);
        takes
    }

    fn value(&mut self, depth: usize) -> Result<Json<'a>, &'static str> {
        if depth > DEPTH {
            return Err("JSON nested too deep");
        }
        self.space();
        match self.peek().ok_or(MALFORMED)? {
            b'{' => self.object(depth),
            b'[' => self.array(depth),
            b'"' => self.string().map(Json::Text),
            b'-' | b'0'..=b'9' => self.number(),
            _ => {
                let rest = &self.text[self.at..];
                let words = [("null", Json::Null), ("true", Json::Bool(true))];
                for (word, value) in words.into_iter().chain([("false", Json::Bool(false))]) {
                    if rest.starts_with(word) {
                        self.at += word.len();
                        return Ok(value);
                    }
                }
                Err(MALFORMED)
            }
        }
    }

    fn object(&mut self, depth: usize) -> Result<Json<'a>, &'static str> {
        self.at += 1;
        let mut entries = Vec::new();
        if self.takes(b'}') {
            return Ok(Json::Object(entries));
        }
        loop {
            self.space();
            let key = self.string()?;
            if !self.takes(b':') {
                return Err(MALFORMED);
            }
            entries.push((key, self.value(depth + 1)?));
            if self.takes(b'}') {
                return Ok(Json::Object(entries));
            }
            if !self.takes(b',') {
                return Err(MALFORMED);
            }
        }
    }

    fn array(&mut self, depth: usize) -> Result<Json<'a>, &'static str> {
        self.at += 1;
        let mut values = Vec::new();
        if self.takes(b']') {
            return Ok(Json::Array(values));
        }
        loop {
            values.push(self.value(depth + 1)?);
            if self.takes(b']') {
                return Ok(Json::Array(values));
            }
            if !self.takes(b',') {
                return Err(MALFORMED);
            }
        }
    }

    fn string(&mut self) -> Result<Cow<'a, str>, &'static str> {
        if self.peek() != Some(b'"') {
            return Err(MALFORMED);
        }
        let start = self.at;
        self.at += 1;
        let mut plain = true;
        loop {
            match self.peek().ok_or(MALFORMED)? {
                b'"' => break,
                b'\\' => {
                    plain = false;
                    self.at += 2;
                }
                0..0x20 => return Err(MALFORMED),
                _ => self.at += 1,
            }
        }
        self.at += 1;
        let quoted = self.text.get(start..self.at).ok_or(MALFORMED)?;
        if plain {
            return Ok(Cow::Borrowed(&quoted[1..quoted.len() - 1]));
        }
        // Halves of surrogate pairs are no text, but may be in a file: they stay escaped.
        let read = serde_json::from_str::<String>(quoted).map(Cow::Owned);
        Ok(read.unwrap_or(Cow::Borrowed(quoted)))
    }

    fn digits(&mut self) -> Result<(), &'static str> {
        let from = self.at;
        while matches!(self.peek(), Some(b'0'..=b'9')) {
            self.at += 1;
        }
        if self.at == from {
            Err(MALFORMED)
        } else {
            Ok(())
        }
    }

    fn number(&mut self) -> Result<Json<'a>, &'static str> {
        let start = self.at;
        self.at += usize::from(self.peek() == Some(b'-'));
        self.digits()?;
        if self.peek() == Some(b'.') {
            self.at += 1;
            self.digits()?;
        }
        if matches!(self.peek(), Some(b'e' | b'E')) {
            self.at += 1;
            self.at += usize::from(matches!(self.peek(), Some(b'+' | b'-')));
            self.digits()?;
        }
        Ok(Json::Number(&self.text[start..self.at]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(a: &str, b: &str) -> Option<(String, String, String)> {
        json(a.as_bytes(), b.as_bytes(), 0.0).map(|diff| (diff.field, diff.a, diff.b))
    }

    #[test]
    fn numbers_are_compared_digit_by_digit() {
        for (a, b) in [
            ("9007199254740993", "9007199254740992"),
            ("18446744073709551617", "18446744073709551616"),
            ("1e400", "2e400"),
            ("0.1", "0.10000000000000000001"),
        ] {
            let found = found(a, b).unwrap();
            assert_eq!(found, ("data".to_owned(), a.to_owned(), b.to_owned()));
        }
        for (a, b) in [
            ("1", "1.0"),
            ("100", "1e2"),
            ("0.5", "5E-1"),
            ("[1 ]", "[1.00]"),
        ] {
            assert_eq!(found(a, b), None, "{a} {b}");
        }
        let within = |a: &str, b: &str| json(a.as_bytes(), b.as_bytes(), 1e-9).is_none();
        assert!(within("1", "1.0000000001") && !within("1", "1.1") && !within("1e999", "1"));
    }

    #[test]
    fn null_is_not_nothing_and_keys_may_be_there_twice() {
        let three = |a: &str, b: &str, c: &str| Some((a.to_owned(), b.to_owned(), c.to_owned()));
        assert_eq!(
            found("{\"a\":null}", "{}"),
            three("data.a", "null", "absent")
        );
        let twice = found("{\"a\":1,\"a\":2}", "{\"a\":2}");
        assert_eq!(twice, three("data.a", "1", "2"));
        let twice = found("{\"a\":1,\"a\":2}", "{\"a\":1}");
        assert_eq!(twice, three("data.a", "2", "absent"));
        assert_eq!(found("{\"a\":1,\"b\":2}", "{\"b\":2,\"a\":1}"), None);
        assert_eq!(found("[1,2]", "[1,2,3]"), three("data.length", "2", "3"));
        assert_eq!(found("\"\\u0041\"", "\"A\""), None);
    }

    #[test]
    fn what_is_no_json_is_compared_by_bytes() {
        let deep = |n: usize| "[".repeat(n) + &"]".repeat(n);
        assert!(found(&deep(100_000), &deep(100_001)).is_some());
        for bad in [
            "{",
            "[1,]",
            "nul",
            "\"\\",
            "01x",
            "\u{1}",
            "{\"a\" 1}",
            "1 2",
        ] {
            assert_eq!(found(bad, "1").unwrap().0, "data", "{bad}");
        }
        let text = "x".repeat(300);
        let (_, a, b) = found(&format!("\"{text}a\""), &format!("\"{text}b\"")).unwrap();
        assert_ne!(a, b);
    }
}
