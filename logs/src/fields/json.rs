//! JSON documents as values.
//!
//! Numbers are kept as they are written, so that integers of any size can be compared digit by digit. Of
//! keys that are there twice, both are kept.

use std::borrow::Cow;

use crate::value::Value;
use crate::value::{DEPTH, Unreadable, VALUES};

/// A JSON document as a value.
///
/// # Errors
/// If it is none, is nested too deep or holds too much.
pub(crate) fn json_value(bytes: &[u8]) -> Result<Value<'_>, Unreadable> {
    parse(bytes).map_err(Unreadable::new)
}

fn parse(bytes: &[u8]) -> Result<Value<'_>, &'static str> {
    let text = std::str::from_utf8(bytes).map_err(|_| "JSON that is not UTF-8")?;
    let mut parser = Parser {
        text,
        at: 0,
        values: 0,
    };
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
    values: usize,
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

    fn value(&mut self, depth: usize) -> Result<Value<'a>, &'static str> {
        if depth > DEPTH {
            return Err("JSON nested too deep");
        }
        self.values += 1;
        if self.values > VALUES {
            return Err("JSON of too many values");
        }
        self.space();
        match self.peek().ok_or(MALFORMED)? {
            b'{' => self.object(depth),
            b'[' => self.array(depth),
            b'"' => self.string().map(Value::Text),
            b'-' | b'0'..=b'9' => self.number(),
            _ => {
                let rest = &self.text[self.at..];
                let words = [("null", Value::Null), ("true", Value::Bool(true))];
                for (word, value) in words.into_iter().chain([("false", Value::Bool(false))]) {
                    if rest.starts_with(word) {
                        self.at += word.len();
                        return Ok(value);
                    }
                }
                Err(MALFORMED)
            }
        }
    }

    fn object(&mut self, depth: usize) -> Result<Value<'a>, &'static str> {
        self.at += 1;
        let mut entries = Vec::new();
        if self.takes(b'}') {
            return Ok(Value::Object(entries));
        }
        loop {
            self.space();
            let key = self.string()?;
            if !self.takes(b':') {
                return Err(MALFORMED);
            }
            entries.push((key, self.value(depth + 1)?));
            if self.takes(b'}') {
                return Ok(Value::Object(entries));
            }
            if !self.takes(b',') {
                return Err(MALFORMED);
            }
        }
    }

    fn array(&mut self, depth: usize) -> Result<Value<'a>, &'static str> {
        self.at += 1;
        let mut values = Vec::new();
        if self.takes(b']') {
            return Ok(Value::List(values));
        }
        loop {
            values.push(self.value(depth + 1)?);
            if self.takes(b']') {
                return Ok(Value::List(values));
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

    fn number(&mut self) -> Result<Value<'a>, &'static str> {
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
        Ok(Value::Decimal(&self.text[start..self.at]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::{FieldDiff, Rules, first};

    fn compared(a: &str, b: &str, tolerance: f64) -> Option<FieldDiff> {
        let rules = Rules::new(tolerance, None);
        let (x, y) = (
            json_value(a.as_bytes()).ok()?,
            json_value(b.as_bytes()).ok()?,
        );
        first(&x, &y, &rules)
    }

    fn found(a: &str, b: &str) -> Option<(String, String, String)> {
        compared(a, b, 0.0).map(|diff| (diff.field, diff.a, diff.b))
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
        let within = |a: &str, b: &str| compared(a, b, 1e-9).is_none();
        assert!(within("1", "1.0000000001") && !within("1", "1.1") && !within("1e999", "1"));
    }

    #[test]
    fn null_is_not_nothing_and_keys_may_be_there_twice() {
        let three = |a: &str, b: &str, c: &str| Some((a.to_owned(), b.to_owned(), c.to_owned()));
        assert_eq!(found("{\"a\":null}", "{}"), three("a", "null", "absent"));
        let twice = found("{\"a\":1,\"a\":2}", "{\"a\":2}");
        assert_eq!(twice, three("a", "1", "2"));
        let twice = found("{\"a\":1,\"a\":2}", "{\"a\":1}");
        assert_eq!(twice, three("a", "2", "absent"));
        assert_eq!(found("{\"a\":1,\"b\":2}", "{\"b\":2,\"a\":1}"), None);
        assert_eq!(found("[1,2]", "[1,2,3]"), three("length", "2", "3"));
        assert_eq!(found("\"\\u0041\"", "\"A\""), None);
    }

    #[test]
    fn what_is_no_json_is_no_value() {
        let deep = "[".repeat(100_000) + &"]".repeat(100_000);
        assert!(json_value(deep.as_bytes()).is_err());
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
            assert!(json_value(bad.as_bytes()).is_err(), "{bad}");
        }
        let text = "x".repeat(300);
        let (_, a, b) = found(&format!("\"{text}a\""), &format!("\"{text}b\"")).unwrap();
        assert_ne!(a, b);
    }
}
