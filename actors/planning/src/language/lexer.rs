//! From text to tokens. Commas are blanks; a comment goes from `;` to the end of the line.

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lexeme {
    /// `(`.
    Open,
    /// `)`.
    Close,
    /// `[`.
    OpenSpan,
    /// `]`.
    CloseSpan,
    /// A name, `True`, `inf`, `<=`.
    Symbol,
    /// `?name`.
    Variable,
    /// `:name`.
    Keyword,
    /// A whole number.
    Number,
    /// A number with a point or an exponent.
    Decimal,
    /// `"text"`.
    Text,
    /// `->`, `-->` or `→`.
    Arrow,
    /// `; text`, without the end of the line.
    Comment,
    /// A text that is not closed, or a `?` or `:` without a name.
    Broken,
}

/// A token and where its text stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token {
    pub(super) lexeme: Lexeme,
    pub(super) start: usize,
    pub(super) end: usize,
}

/// The tokens of a text.
pub(super) struct Lexer<'t> {
    text: &'t str,
    at: usize,
}

impl<'t> Lexer<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Lexer { text, at: 0 }
    }
}

const ARROWS: [&str; 3] = ["→", "-->", "->"];

fn is_blank(letter: char) -> bool {
    letter.is_whitespace() || letter == ',' || letter == '\u{feff}'
}

/// Whether a letter ends the word before it. `?` and `:` start the next one.
fn ends_word(letter: char) -> bool {
    is_blank(letter) || matches!(letter, '(' | ')' | '[' | ']' | '"' | ';' | '?' | ':' | '→')
}

/// How long the word is that a text starts with, whose first letter is taken for granted.
fn word_length(text: &str) -> usize {
    for (at, letter) in text.char_indices().skip(1) {
        let arrow = letter == '-' && ARROWS.iter().any(|arrow| text[at..].starts_with(arrow));
        if arrow || ends_word(letter) {
            return at;
        }
    }
    text.len()
}

fn word(text: &str) -> Lexeme {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    match text.as_bytes()[0] {
        b'?' | b':' if text.len() == 1 => Lexeme::Broken,
        b'?' => Lexeme::Variable,
        b':' => Lexeme::Keyword,
        _ if !digits.starts_with(|letter: char| letter.is_ascii_digit()) => Lexeme::Symbol,
        _ if digits.bytes().all(|byte| byte.is_ascii_digit()) => Lexeme::Number,
        // Of what starts with a digit, `1e5` and `2.5` are numbers, `2_rovers` is a name.
        _ if text.parse::<f64>().is_ok() => Lexeme::Decimal,
        _ => Lexeme::Symbol,
    }
}

impl Iterator for Lexer<'_> {
    type Item = Token;

    fn next(&mut self) -> Option<Token> {
        let rest = &self.text[self.at..];
        let start = self.at + (rest.len() - rest.trim_start_matches(is_blank).len());
        let rest = &self.text[start..];
        let first = rest.chars().next()?;
        let (lexeme, length) = match first {
            '(' => (Lexeme::Open, 1),
            ')' => (Lexeme::Close, 1),
            '[' => (Lexeme::OpenSpan, 1),
            ']' => (Lexeme::CloseSpan, 1),
            ';' => {
                let line = rest.find('\n').unwrap_or(rest.len());
                (Lexeme::Comment, rest[..line].trim_end().len())
            }
            '"' => match rest[1..].find(['"', '\n']) {
                Some(end) if rest.as_bytes()[1 + end] == b'"' => (Lexeme::Text, end + 2),
                Some(end) => (Lexeme::Broken, end + 1),
                None => (Lexeme::Broken, rest.len()),
            },
            _ => match ARROWS.iter().find(|arrow| rest.starts_with(**arrow)) {
                Some(arrow) => (Lexeme::Arrow, arrow.len()),
                None => {
                    let length = word_length(rest);
                    (word(&rest[..length]), length)
                }
            },
        };
        self.at = start + length;
        Some(Token {
            lexeme,
            start,
            end: self.at,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &[(Lexeme, &str)]) {
        let tokens = Lexer::new(text).map(|token| (token.lexeme, &text[token.start..token.end]));
        assert_eq!(tokens.collect::<Vec<_>>(), expected, "{text:?}");
    }

    #[test]
    fn a_question_mark_starts_a_new_symbol_and_commas_are_blanks() {
        let (a, b) = (
            (Lexeme::Variable, "?state_fan"),
            (Lexeme::Variable, "?temp"),
        );
        check("?state_fan?temp", &[a, b]);
        check("?state_fan,?temp", &[a, b]);
        check("a:b", &[(Lexeme::Symbol, "a"), (Lexeme::Keyword, ":b")]);
    }

    #[test]
    fn arrows_are_equal_and_end_words() {
        let (a, b) = ((Lexeme::Variable, "?a"), (Lexeme::Symbol, "b-c"));
        for arrow in ARROWS {
            check(&format!("?a{arrow}b-c"), &[a, (Lexeme::Arrow, arrow), b]);
        }
    }

    #[test]
    fn numbers_are_told_from_names() {
        check("-5 +7", &[(Lexeme::Number, "-5"), (Lexeme::Number, "+7")]);
        check(
            "12.5 1e5",
            &[(Lexeme::Decimal, "12.5"), (Lexeme::Decimal, "1e5")],
        );
        check(
            "-inf 2_rovers",
            &[(Lexeme::Symbol, "-inf"), (Lexeme::Symbol, "2_rovers")],
        );
        check("- <=", &[(Lexeme::Symbol, "-"), (Lexeme::Symbol, "<=")]);
    }

    #[test]
    fn what_is_broken_ends_with_its_line() {
        check(
            "\"a\" \"b\n?",
            &[
                (Lexeme::Text, "\"a\""),
                (Lexeme::Broken, "\"b"),
                (Lexeme::Broken, "?"),
            ],
        );
        check(
            "a ; b \r\nc",
            &[
                (Lexeme::Symbol, "a"),
                (Lexeme::Comment, "; b"),
                (Lexeme::Symbol, "c"),
            ],
        );
    }
}
