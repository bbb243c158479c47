//! From tokens to a tree, going on after a mistake.

use super::findings::{Notes, Severity};
use super::lexer::{Lexeme, Lexer, Token};
use super::tree::{Comment, Kind, Node, Source, Tree, show};

/// How many lists and spans may be in one another.
pub(super) const MOST_DEPTH: usize = 100;

/// What starts a line only at the top: where it stands within a list, that list was not closed.
const AT_THE_TOP: [&str; 7] = [
    "(Define_",
    "(Include",
    "(Fact",
    "(Combination",
    "(Order",
    "(Level",
    "(Change",
];

/// Reads a text. With `strict`, a `SINGLE` that is not closed is an error.
pub(super) fn parse(file: u32, text: String, strict: bool, notes: &mut Notes) -> Tree {
    let source = Source::new(file, text);
    let mut parser = Parser {
        source: &source,
        strict,
        notes,
        nodes: Vec::new(),
        comments: Vec::new(),
        open: Vec::new(),
        too_deep: 0,
        last_end: 0,
    };
    for token in Lexer::new(&source.text) {
        parser.take(token);
        parser.last_end = token.end;
    }
    while let Some(list) = parser.open.pop() {
        parser.unclosed(list, source.text.len(), "the end of the file");
        parser.close(list);
    }
    let Parser {
        nodes, comments, ..
    } = parser;
    Tree {
        source,
        nodes,
        comments,
    }
}

struct Parser<'a> {
    source: &'a Source,
    strict: bool,
    notes: &'a mut Notes,
    nodes: Vec<Node>,
    comments: Vec<Comment>,
    /// The lists and spans that are not closed yet, the innermost last.
    open: Vec<u32>,
    /// How many lists are open that are too deep to be kept.
    too_deep: usize,
    /// Where the last token ended.
    last_end: usize,
}

impl Parser<'_> {
    fn take(&mut self, token: Token) {
        let Token { lexeme, start, end } = token;
        let source = self.source;
        let word = &source.text[start..end];
        if self.too_deep > 0 {
            match lexeme {
                Lexeme::Open | Lexeme::OpenSpan => self.too_deep += 1,
                Lexeme::Close | Lexeme::CloseSpan => self.too_deep -= 1,
                _ => {}
            }
            return;
        }
        match lexeme {
            Lexeme::Open => self.begin(Kind::List, start),
            Lexeme::OpenSpan => self.begin(Kind::Span, start),
            Lexeme::Close => self.end_of(Kind::List, start),
            Lexeme::CloseSpan => self.end_of(Kind::Span, start),
            Lexeme::Comment => self.comment(start, end),
            Lexeme::Broken if word.starts_with('"') => {
                self.note(Severity::Error, start, "a text closed by \"", &show(word));
                self.leaf(Kind::Text, start, end);
            }
            Lexeme::Broken => {
                self.note(
                    Severity::Error,
                    start,
                    &format!("a name after {word}"),
                    "none",
                );
            }
            Lexeme::Keyword => {
                self.close_single(start, word);
                self.leaf(Kind::Keyword, start, end);
            }
            Lexeme::Symbol => self.leaf(Kind::Symbol, start, end),
            Lexeme::Variable => self.leaf(Kind::Variable, start, end),
            Lexeme::Number => self.leaf(Kind::Number, start, end),
            Lexeme::Decimal => self.leaf(Kind::Decimal, start, end),
            Lexeme::Text => self.leaf(Kind::Text, start, end),
            Lexeme::Arrow => self.leaf(Kind::Arrow, start, end),
        }
    }

    fn leaf(&mut self, kind: Kind, start: usize, end: usize) {
        let next = self.nodes.len() as u32 + 1;
        let apart = self.open.is_empty() && self.apart(start);
        let (start, end) = (start as u32, end as u32);
        self.nodes.push(Node {
            kind,
            apart,
            start,
            end,
            next,
        });
    }

    fn begin(&mut self, kind: Kind, start: usize) {
        if let Some(&outer) = self.open.first()
            && starts_form(
                self.nodes[outer as usize].start as usize,
                start,
                &self.source.text,
            )
        {
            while let Some(list) = self.open.pop() {
                if self.open.is_empty() {
                    self.unclosed(list, start, "a form that starts a line");
                }
                self.close(list);
            }
        }
        if self.open.len() == MOST_DEPTH {
            let expected = format!("at most {MOST_DEPTH} lists in one another");
            self.note(Severity::Error, start, &expected, "one more");
            self.too_deep = 1;
            return;
        }
        let place = self.nodes.len() as u32;
        self.leaf(kind, start, start);
        self.open.push(place);
    }

    /// A closing parenthesis or bracket.
    fn end_of(&mut self, kind: Kind, start: usize) {
        let found = if kind == Kind::List { ")" } else { "]" };
        let Some(&list) = self.open.last() else {
            self.note(Severity::Error, start, "a form", found);
            return;
        };
        if self.nodes[list as usize].kind == kind {
            self.open.pop();
            self.close(list);
            return;
        }
        let expected = if kind == Kind::List { "]" } else { ")" };
        self.note(Severity::Error, start, expected, found);
        // A parenthesis closes the span and the list around it, a stray bracket nothing.
        if kind == Kind::List {
            self.open.pop();
            self.close(list);
            if let Some(list) = self.open.pop() {
                self.close(list);
            }
        }
    }

    fn close(&mut self, list: u32) {
        self.nodes[list as usize].next = self.nodes.len() as u32;
    }

    /// Figure 5 of the IDEA paper as printed: a keyword directly within a `SINGLE` closes it.
    fn close_single(&mut self, start: usize, word: &str) {
        let Some(&list) = self.open.last() else {
            return;
        };
        let first = self.nodes.get(list as usize + 1);
        let is_single = first.is_some_and(|node| {
            node.kind == Kind::Symbol
                && &self.source.text[node.start as usize..node.end as usize] == "SINGLE"
        });
        if !is_single || self.nodes[list as usize].kind != Kind::List {
            return;
        }
        let severity = if self.strict {
            Severity::Error
        } else {
            Severity::Warning
        };
        self.note(severity, start, ") to close SINGLE", &show(word));
        self.open.pop();
        self.close(list);
    }

    fn comment(&mut self, start: usize, end: usize) {
        let line = self.source.text[..start].rfind('\n').map_or(0, |at| at + 1);
        let alone = self.source.text[line..start].trim().is_empty();
        let apart = self.open.is_empty() && self.apart(start);
        self.comments.push(Comment {
            start: start as u32,
            end: end as u32,
            alone,
            apart,
            before: self.nodes.len() as u32,
            within: self.open.last().copied(),
        });
    }

    /// Whether a blank line stands before a place where a token starts.
    fn apart(&self, start: usize) -> bool {
        let between = &self.source.text[self.last_end..start];
        let ends = between.bytes().filter(|byte| *byte == b'\n').take(2);
        self.last_end > 0 && ends.count() == 2
    }

    fn unclosed(&mut self, list: u32, at: usize, found: &str) {
        let Node { kind, start, .. } = self.nodes[list as usize];
        let close = if kind == Kind::Span { ']' } else { ')' };
        let opened = self.source.position(start as usize);
        let expected = format!("{close} for the one opened at {opened}");
        self.note(Severity::Error, at, &expected, found);
    }

    fn note(&mut self, severity: Severity, at: usize, expected: &str, found: &str) {
        let position = self.source.position(at);
        self.notes.note(severity, position, expected, found);
    }
}

/// Whether a line starts here with a form that stands only at the top, within one that starts at
/// `outer`.
fn starts_form(outer: usize, start: usize, text: &str) -> bool {
    let begins = start == 0 || text.as_bytes()[start - 1] == b'\n';
    let is_one = |head: &str| text[start..].starts_with(head);
    // `Goal` is a word of classes too, whose forms begin with `Define_`.
    let is_goal = is_one("(Goal ") && !text[outer..].starts_with("(Define_");
    begins && (is_goal || AT_THE_TOP.iter().any(|head| is_one(head)))
}
