//! What a text says, as a tree: lists, spans and words, with the comments between them.
//!
//! A tree is one vector in the order of the text, so that a list of any depth is made and dropped
//! without recursion.

use crate::model::Position;

/// Longer names are cut in messages.
const LONGEST_NAME: usize = 60;

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `( … )`.
    List,
    /// `[ … ]`.
    Span,
    Symbol,
    Variable,
    Keyword,
    Number,
    Decimal,
    Text,
    Arrow,
}

/// A node, whose children follow it up to `next`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) kind: Kind,
    /// Whether a blank line stands before it.
    pub(super) apart: bool,
    /// Where it starts in the text.
    pub(super) start: u32,
    /// Where it ends, if it is a word.
    pub(super) end: u32,
    /// The place of the first node that is not within it.
    pub(super) next: u32,
}

/// A comment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comment {
    pub(super) start: u32,
    pub(super) end: u32,
    /// Whether it has a line of its own.
    pub(super) alone: bool,
    /// Whether a blank line stands before it.
    pub(super) apart: bool,
    /// The place of the node before which it stands, or of the first one after its list.
    pub(super) before: u32,
    /// The list within which it stands; none at the top.
    pub(super) within: Option<u32>,
}

/// How many bytes of a text there are between two places whose character is known.
const BLOCK: usize = 512;

/// A text, and which line and character each of its bytes is at.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    /// The place of the file's name among those read.
    pub(super) file: u32,
    pub(super) text: String,
    /// Where the lines start.
    lines: Vec<u32>,
    /// By block of bytes: how many characters start before it, so that a long line costs no more
    /// than others.
    characters: Vec<u32>,
}

impl Source {
    /// Of a text shorter than 4 GB.
    pub(super) fn new(file: u32, text: String) -> Source {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let mut lines = vec![0];
        lines.extend(ends.map(|(at, _)| at as u32 + 1));
        let mut characters = vec![0];
        for block in text.as_bytes().chunks(BLOCK) {
            characters.push(characters.last().copied().unwrap_or(0) + starts(block));
        }
        Source {
            file,
            text,
            lines,
            characters,
        }
    }

    /// The line and the character of a place in the text.
    pub(super) fn position(&self, at: usize) -> Position {
        let line = self.lines.partition_point(|&start| start as usize <= at);
        let start = self.lines[line - 1] as usize;
        Position {
            file: self.file,
            line: line as u32,
            column: self.characters_before(at) - self.characters_before(start) + 1,
        }
    }

    fn characters_before(&self, at: usize) -> u32 {
        let block = at / BLOCK;
        self.characters[block] + starts(&self.text.as_bytes()[block * BLOCK..at])
    }
}

/// How many characters start within some bytes of a text.
fn starts(bytes: &[u8]) -> u32 {
    bytes.iter().filter(|&&byte| byte & 0xC0 != 0x80).count() as u32
}

/// A text with its tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    pub(super) source: Source,
    pub(super) nodes: Vec<Node>,
    pub(super) comments: Vec<Comment>,
}

impl Tree {
    /// A node, as something to ask.
    pub(super) fn form(&self, node: u32) -> Form<'_> {
        Form { tree: self, node }
    }

    /// What stands at the top.
    pub(super) fn forms(&self) -> Children<'_> {
        Children {
            tree: self,
            at: 0,
            end: self.nodes.len() as u32,
        }
    }

    /// The text of a word; arrows are all the same.
    pub(super) fn word(&self, node: usize) -> &str {
        let Node {
            kind, start, end, ..
        } = self.nodes[node];
        match kind {
            Kind::Arrow => "->",
            _ => &self.source.text[start as usize..end as usize],
        }
    }
}

/// Trees are the same if they say the same, with the same comments, on whichever lines it stands.
impl PartialEq for Tree {
    fn eq(&self, other: &Tree) -> bool {
        let same = |node: usize| {
            let (a, b) = (self.nodes[node], other.nodes[node]);
            a.kind == b.kind && a.next == b.next && self.word(node) == other.word(node)
        };
        let comments = |tree: &Tree| -> Vec<_> {
            let comments = tree.comments.iter();
            let text = |at: &Comment| &tree.source.text[at.start as usize..at.end as usize];
            comments
                .map(|at| (text(at).to_owned(), at.before, at.within))
                .collect()
        };
        self.nodes.len() == other.nodes.len()
            && (0..self.nodes.len()).all(same)
            && comments(self) == comments(other)
    }
}

/// A node in its tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form<'t> {
    tree: &'t Tree,
    node: u32,
}

impl<'t> Form<'t> {
    /// Its place in the tree.
    pub(super) fn node(self) -> u32 {
        self.node
    }

    pub(super) fn kind(self) -> Kind {
        self.tree.nodes[self.node as usize].kind
    }

    /// How many nodes it has, itself counted.
    pub(super) fn size(self) -> usize {
        (self.tree.nodes[self.node as usize].next - self.node) as usize
    }

    pub(super) fn is_list(self) -> bool {
        self.kind() == Kind::List
    }

    /// The text of a word; nothing of a list or a span.
    pub(super) fn word(self) -> &'t str {
        match self.kind() {
            Kind::List | Kind::Span => "",
            _ => self.tree.word(self.node as usize),
        }
    }

    /// The text, if it is a symbol.
    pub(super) fn symbol(self) -> Option<&'t str> {
        (self.kind() == Kind::Symbol).then(|| self.word())
    }

    /// Whether it is a list whose first word is this one.
    pub(super) fn is_form(self, head: &str) -> bool {
        self.head() == Some(head)
    }

    /// The first word of a list, if it is a symbol.
    pub(super) fn head(self) -> Option<&'t str> {
        let first = self.children().next().filter(|_| self.is_list())?;
        first.symbol()
    }

    pub(super) fn children(self) -> Children<'t> {
        let end = match self.kind() {
            Kind::List | Kind::Span => self.tree.nodes[self.node as usize].next,
            _ => self.node + 1,
        };
        Children {
            tree: self.tree,
            at: self.node + 1,
            end,
        }
    }

    pub(super) fn position(self) -> Position {
        let start = self.tree.nodes[self.node as usize].start;
        self.tree.source.position(start as usize)
    }

    /// What a message shows of it.
    pub(super) fn show(self) -> String {
        let head = self.children().next();
        match (self.kind(), head) {
            (Kind::List, None) => "()".to_owned(),
            (Kind::List, Some(head)) if !head.word().is_empty() => {
                format!("({} …)", show(head.word()))
            }
            (Kind::List, Some(_)) => "a list of lists".to_owned(),
            (Kind::Span, _) => {
                let words: Vec<String> =
                    self.children().take(3).map(|at| show(at.word())).collect();
                format!("[{}]", words.join(" "))
            }
            _ => show(self.word()),
        }
    }
}

/// Nodes beside each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Children<'t> {
    tree: &'t Tree,
    at: u32,
    end: u32,
}

impl<'t> Iterator for Children<'t> {
    type Item = Form<'t>;

    fn next(&mut self) -> Option<Form<'t>> {
        if self.at >= self.end {
            return None;
        }
        let form = Form {
            tree: self.tree,
            node: self.at,
        };
        self.at = self.tree.nodes[self.at as usize].next;
        Some(form)
    }
}

/// A piece of text as a message shows it.
pub(super) fn show(text: &str) -> String {
    let mut shown: String = text
        .chars()
        .take(LONGEST_NAME)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().nth(LONGEST_NAME).is_some() {
        shown.push('…');
    }
    shown
}
