//! The normal form of a text.

use super::findings::{Findings, Notes};
use super::parser::parse;
use super::tree::{Comment, Kind, Tree};

/// A list that fits on a line this long stands on one.
const WIDTH: usize = 96;

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
/// first words, then each of its other children on a line of its own, but an option that fits with
/// its values.
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
        let (inner, end) = (indent + 1, tree.nodes[node as usize].next);
        // Whether the line is new, so that what comes next is not preceded by a blank.
        let mut fresh = self.first_trailing(node);
        // Up to where children stay on the line: the first words, then an option that fits.
        let mut line_until = self.head_end(node, indent, closing);
        for child in tree.form(node).children() {
            let at = child.node();
            if !fresh && self.next_comment(at, Some(node)).is_some() {
                self.end_line();
                fresh = true;
            }
            self.comments_before(at, Some(node), inner);
            let is_last = tree.nodes[at as usize].next == end;
            let after = if is_last { closing + 1 } else { 0 };
            if at == node + 1 && !fresh {
                self.column = self.column.max(inner);
            } else if !fresh && at < line_until {
                self.text(" ");
            } else {
                if !fresh {
                    self.end_line();
                }
                self.indent(inner);
                if child.kind() == Kind::Keyword {
                    line_until = self.option_end(at, end, inner, closing);
                }
            }
            let column = self.column;
            self.node(at, column, after);
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

    /// A comment that follows the parenthesis of a list; whether there is one.
    fn first_trailing(&mut self, list: u32) -> bool {
        let first = self.next_comment(list + 1, Some(list));
        let Some(comment) = first.filter(|comment| !comment.alone) else {
            return false;
        };
        self.comment += 1;
        self.text(" ");
        self.write_comment(comment);
        self.end_line();
        true
    }

    /// The node up to which the first words and spans of a list stay on its first line.
    fn head_end(&self, list: u32, indent: usize, closing: usize) -> u32 {
        let mut column = indent + 1;
        let mut end = list + 1;
        for child in self.tree.form(list).children().take(3) {
            let is_word = !matches!(child.kind(), Kind::List | Kind::Keyword);
            column += self.widths[child.node() as usize] + 1;
            if !is_word || column + closing > WIDTH {
                break;
            }
            end = self.tree.nodes[child.node() as usize].next;
        }
        end
    }

    /// The node up to which an option stays on one line: its keyword alone, if it does not fit.
    fn option_end(&self, keyword: u32, list_end: u32, indent: usize, closing: usize) -> u32 {
        let mut column = indent + self.widths[keyword as usize];
        let mut at = keyword + 1;
        while at < list_end && self.tree.nodes[at as usize].kind != Kind::Keyword {
            column += 1 + self.widths[at as usize];
            at = self.tree.nodes[at as usize].next;
        }
        let closing = if at == list_end { closing + 1 } else { 0 };
        let comments = &self.tree.comments[self.comment..];
        let within = comments.first().is_some_and(|comment| comment.before < at);
        if within || column + closing > WIDTH {
            keyword + 1
        } else {
            at
        }
    }
}

fn signs(tree: &Tree, node: u32) -> (&'static str, &'static str) {
    match tree.nodes[node as usize].kind {
        Kind::Span => ("[", "]"),
        _ => ("(", ")"),
    }
}
