//! The normal form of a text.

use super::findings::{Findings, Notes};
use super::parser::parse;
use super::tree::{Comment, Kind, Tree};

/// A list that fits on a line this long stands on one.
const WIDTH: usize = 88;

/// Writes a text in its normal form.
pub(super) fn format(text: &str) -> Result<String, Findings> {
    let mut notes = Notes::default();
    notes.files.push("text".to_owned());
    if text.len() > super::include::MOST_BYTES {
        let start = crate::model::Position {
            file: 0,
            line: 1,
            column: 1,
        };
        let expected = std::format!("at most {} bytes", super::include::MOST_BYTES);
        let found = text.len().to_string();
        notes.note(super::Severity::Error, start, expected, found);
        return Err(Findings(notes.finish().0));
    }
    let tree = parse(0, text.to_owned(), false, &mut notes);
    if notes.has_errors() {
        return Err(Findings(notes.finish().0));
    }
    Ok(write(&tree))
}

/// The normal form of a tree: a list on one line if it fits and no comment stands in it; else its
/// first words, then each of its other children on a line of its own, a keyword with its first
/// value.
fn write(tree: &Tree) -> String {
    let widths = widths(tree);
    let mut writer = Writer {
        tree,
        widths,
        out: String::new(),
        column: 0,
        comment: 0,
    };
    for form in tree.forms() {
        let node = form.node();
        writer.comments_before(node, None, 0);
        writer.apart(tree.nodes[node as usize].apart);
        writer.node(node, 0, 0);
        writer.trailing(node, None);
        writer.end_line();
    }
    writer.comments_before(tree.nodes.len() as u32, None, 0);
    writer.out
}

/// By node: how many characters it has on one line; too many if a comment stands within it.
fn widths(tree: &Tree) -> Vec<usize> {
    let mut widths = vec![0_usize; tree.nodes.len()];
    let commented = tree.comments.iter().filter_map(|comment| comment.within);
    for list in commented {
        widths[list as usize] = WIDTH * 2;
    }
    for node in (0..tree.nodes.len()).rev() {
        widths[node] += match tree.nodes[node].kind {
            Kind::List | Kind::Span => {
                let children = tree.form(node as u32).children();
                let within = children.map(|child| widths[child.node() as usize] + 1);
                // A space between children, and the parentheses.
                within.fold(0, usize::saturating_add).max(1) + 1
            }
            _ => tree.word(node).chars().count(),
        };
    }
    widths
}

struct Writer<'t> {
    tree: &'t Tree,
    widths: Vec<usize>,
    out: String,
    column: usize,
    /// The comment that is written next.
    comment: usize,
}

impl Writer<'_> {
    fn text(&mut self, text: &str) {
        self.out.push_str(text);
        self.column += text.chars().count();
    }

    fn end_line(&mut self) {
        self.out.push('\n');
        self.column = 0;
    }

    fn indent(&mut self, indent: usize) {
        self.out.extend(std::iter::repeat_n(' ', indent));
        self.column = indent;
    }

    /// A blank line, if there was one.
    fn apart(&mut self, apart: bool) {
        if apart && !self.out.is_empty() {
            self.out.push('\n');
        }
    }

    fn next_comment(&self, before: u32, within: Option<u32>) -> Option<Comment> {
        let comment = self.tree.comments.get(self.comment)?;
        (comment.before == before && comment.within == within).then_some(*comment)
    }

    /// The comments on lines of their own before a node, or before the end of a list.
    fn comments_before(&mut self, node: u32, within: Option<u32>, indent: usize) {
        while let Some(comment) = self.next_comment(node, within) {
            self.comment += 1;
            self.apart(comment.apart);
            self.indent(indent);
            self.write_comment(comment);
            self.end_line();
        }
    }

    /// A comment on the line of what was just written.
    fn trailing(&mut self, node: u32, within: Option<u32>) {
        let next = self.tree.nodes[node as usize].next;
        if let Some(comment) = self
            .next_comment(next, within)
            .filter(|comment| !comment.alone)
        {
            self.comment += 1;
            self.text(" ");
            self.write_comment(comment);
        }
    }

    fn write_comment(&mut self, comment: Comment) {
        let tree = self.tree;
        self.text(&tree.source.text[comment.start as usize..comment.end as usize]);
    }

    /// A node that starts where the line stands; `closing` parentheses follow it on its line.
    fn node(&mut self, node: u32, indent: usize, closing: usize) {
        let fits = self.column + self.widths[node as usize] + closing <= WIDTH;
        match self.tree.nodes[node as usize].kind {
            Kind::List | Kind::Span if !fits => self.broken(node, indent, closing),
            Kind::List | Kind::Span => self.flat(node),
            _ => {
                let tree = self.tree;
                self.text(tree.word(node as usize));
            }
        }
    }

    fn flat(&mut self, node: u32) {
        let tree = self.tree;
        match tree.nodes[node as usize].kind {
            Kind::List | Kind::Span => {
                let (open, close) = signs(tree, node);
                self.text(open);
                for (place, child) in tree.form(node).children().enumerate() {
                    if place > 0 {
                        self.text(" ");
                    }
                    self.flat(child.node());
                }
                self.text(close);
            }
            _ => self.text(tree.word(node as usize)),
        }
    }

    /// A list over several lines.
    fn broken(&mut self, node: u32, indent: usize, closing: usize) {
        let tree = self.tree;
        let (open, close) = signs(tree, node);
        self.text(open);
        let inner = indent + 1;
        let end = tree.nodes[node as usize].next;
        let mut fresh = false;
        let first_comment = self.next_comment(node + 1, Some(node));
        if let Some(comment) = first_comment.filter(|comment| !comment.alone) {
            self.comment += 1;
            self.text(" ");
            self.write_comment(comment);
            self.end_line();
            fresh = true;
        }
        let mut before: Option<Kind> = None;
        for (place, child) in tree.form(node).children().enumerate() {
            let at = child.node();
            let alone = self.next_comment(at, Some(node)).is_some();
            if alone && !fresh {
                self.end_line();
                fresh = true;
            }
            self.comments_before(at, Some(node), inner);
            let last = tree.nodes[at as usize].next == end;
            let after = if last { closing + 1 } else { 0 };
            // The head's words stay on its line, and a value on that of its keyword.
            let kind = child.kind();
            let is_word = !matches!(kind, Kind::List | Kind::Span | Kind::Keyword);
            let stays = before == Some(Kind::Keyword) || (place < 3 && is_word);
            let room = self.column + 1 + self.widths[at as usize] + after <= WIDTH || !is_word;
            let column = match (fresh, place) {
                (true, _) => {
                    self.indent(inner);
                    inner
                }
                (false, 0) => inner,
                (false, _) if stays && room && kind != Kind::Keyword => {
                    self.text(" ");
                    self.column
                }
                (false, _) => {
                    self.end_line();
                    self.indent(inner);
                    inner
                }
            };
            self.node(at, column, after);
            before = Some(kind);
            let comments = self.comment;
            self.trailing(at, Some(node));
            fresh = self.comment > comments;
            if fresh {
                self.end_line();
            }
        }
        if self.next_comment(end, Some(node)).is_some() {
            if !fresh {
                self.end_line();
            }
            fresh = true;
            self.comments_before(end, Some(node), inner);
        }
        if fresh {
            self.indent(indent);
        }
        self.text(close);
    }
}

fn signs(tree: &Tree, node: u32) -> (&'static str, &'static str) {
    match tree.nodes[node as usize].kind {
        Kind::Span => ("[", "]"),
        _ => ("(", ")"),
    }
}
