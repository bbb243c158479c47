//! Words, numbers, texts and signs of IDL, without comments and lines for a preprocessor.

/// A part of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    Word(&'a str),
    Number(&'a str),
    Text(&'a str),
    Sign(&'a str),
}

/// The tokens of a text, one after the other.
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
    line: usize,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        let (at, line) = (0, 1);
        Tokens { text, at, line }
    }

    /// The line of what is read next.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    /// The next token, which stays the next.
    pub(super) fn peek(&mut self) -> Result<Option<Token<'a>>, String> {
        self.skip()?;
        Ok(self.token()?.map(|(token, _)| token))
    }

    /// The next token.
    pub(super) fn next(&mut self) -> Result<Option<Token<'a>>, String> {
        self.skip()?;
        let Some((token, length)) = self.token()? else {
            return Ok(None);
        };
        self.pass(length);
        Ok(Some(token))
    }

    pub(super) fn is_at(&mut self, sign: &str) -> Result<bool, String> {
        Ok(self.peek()? == Some(Token::Sign(sign)))
    }

    /// Passes a sign, if it is next; says whether.
    pub(super) fn take(&mut self, sign: &str) -> Result<bool, String> {
        let takes = self.is_at(sign)?;
        if takes {
            self.next()?;
        }
        Ok(takes)
    }

    pub(super) fn expect(&mut self, sign: &str) -> Result<(), String> {
        match self.take(sign)? {
            true => Ok(()),
            false => Err(format!("expected {sign:?}, found {}", self.found()?)),
        }
    }

    /// The next token, which is a word.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, String> {
        match self.peek()? {
            Some(Token::Word(word)) => {
                self.next()?;
                // A word that is escaped is none of the language.
                Ok(word.strip_prefix('_').unwrap_or(word))
            }
            _ => Err(format!("expected {what}, found {}", self.found()?)),
        }
    }

    /// Passes a group in brackets or braces, with all groups in it; gives its text.
    pub(super) fn skip_group(&mut self) -> Result<String, String> {
        let mut open = 0usize;
        let mut inner = String::new();
        loop {
            let token = self.next()?.ok_or("a group that does not end")?;
            match token {
                Token::Sign("(" | "{" | "[") => open += 1,
                Token::Sign(")" | "}" | "]") => open = open.saturating_sub(1),
                Token::Word(text) | Token::Number(text) | Token::Text(text) => {
                    inner.push_str(text);
                }
                Token::Sign(sign) => inner.push_str(sign),
            }
            if open == 0 {
                return Ok(inner);
            }
        }
    }

    fn found(&mut self) -> Result<String, String> {
        Ok(match self.peek()? {
            None => "the end of the schema".to_owned(),
            Some(Token::Word(text) | Token::Number(text) | Token::Text(text)) => {
                format!("{text:?}")
            }
            Some(Token::Sign(sign)) => format!("{sign:?}"),
        })
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn pass(&mut self, bytes: usize) {
        let passed = &self.rest()[..bytes];
        self.line += passed.bytes().filter(|byte| *byte == b'\n').count();
        self.at += bytes;
    }

    /// Passes what is between tokens.
    fn skip(&mut self) -> Result<(), String> {
        loop {
            let rest = self.rest();
            let blank = rest.len() - rest.trim_start().len();
            if blank > 0 {
                self.pass(blank);
            } else if rest.starts_with("//") || rest.starts_with('#') || self.is_separator() {
                let length = rest.find('\n').unwrap_or(rest.len());
                self.pass(length);
            } else if let Some(comment) = rest.strip_prefix("/*") {
                let length = comment.find("*/").ok_or("a comment that does not end")?;
                self.pass(length + 4);
            } else {
                return Ok(());
            }
        }
    }

    /// Lines between the files of a schema: of `=`, and `IDL: pkg/msg/Type` behind it.
    fn is_separator(&self) -> bool {
        let rest = self.rest();
        let starts = self.text[..self.at].ends_with('\n') || self.at == 0;
        starts && (rest.starts_with("==========") || rest.starts_with("IDL:"))
    }

    fn token(&self) -> Result<Option<(Token<'a>, usize)>, String> {
        let rest = self.rest();
        let Some(first) = rest.chars().next() else {
            return Ok(None);
        };
        let while_in =
            |is_in: fn(char) -> bool| rest.find(|letter| !is_in(letter)).unwrap_or(rest.len());
        let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
        if first.is_alphabetic() || first == '_' {
            let length = while_in(is_word);
            return Ok(Some((Token::Word(&rest[..length]), length)));
        }
        if first.is_ascii_digit() || first == '-' || first == '+' {
            let digits = rest[1..].find(|letter: char| !is_word(letter) && letter != '.');
            let length = digits.map_or(rest.len(), |digits| digits + 1);
            return Ok(Some((Token::Number(&rest[..length]), length)));
        }
        if first == '"' || first == '\'' {
            let mut escaped = false;
            for (at, letter) in rest.char_indices().skip(1) {
                match letter {
                    _ if escaped => escaped = false,
                    '\\' => escaped = true,
                    letter if letter == first => {
                        return Ok(Some((Token::Text(&rest[1..at]), at + 1)));
                    }
                    _ => {}
                }
            }
            return Err("a text that does not end".to_owned());
        }
        let length = match rest.starts_with("::") {
            true => 2,
            false => first.len_utf8(),
        };
        Ok(Some((Token::Sign(&rest[..length]), length)))
    }
}
