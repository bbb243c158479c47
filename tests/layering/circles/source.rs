//! What a file imports, read from its code without a compiler: good enough for code that rustfmt
//! has formatted.

use super::super::is_word;

/// A name that a file imports, and the path it has there.
pub(super) struct Import {
    /// `None` for all names of a module: `use path::*`.
    pub(super) name: Option<String>,
    pub(super) path: Vec<String>,
}

/// True if the code declares an item of this name.
pub(super) fn declares(code: &str, name: &str) -> bool {
    let mut words = code
        .split(|c: char| !is_word(c))
        .filter(|word| !word.is_empty());
    let mut before = "";
    words.any(|word| {
        let declared = word == name
            && matches!(
                before,
                "struct"
                    | "enum"
                    | "trait"
                    | "type"
                    | "fn"
                    | "const"
                    | "static"
                    | "mod"
                    | "macro_rules"
            );
        before = word;
        declared
    })
}

/// The end of the block that begins at the first `{` of `code`.
fn end_of_block(code: &str) -> usize {
    let mut depth = 0;
    for (at, next) in code.char_indices() {
        match next {
            '{' => depth += 1,
            '}' if depth == 1 => return at + 1,
            '}' => depth -= 1,
            _ => {}
        }
    }
    code.len()
}

/// The code without its inline test modules.
pub(super) fn without_tests(code: &str) -> String {
    let mut kept = String::new();
    let mut rest = code;
    while let Some(at) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..at]);
        let after = &rest[at..];
        let (brace, end) = (after.find('{'), after.find(';'));
        let skipped = match (brace, end) {
            (Some(brace), end) if end.is_none_or(|end| brace < end) => end_of_block(after),
            (_, Some(end)) => end + 1,
            _ => after.len(),
        };
        rest = &after[skipped..];
    }
    kept + rest
}

/// The modules in files of their own that are built for tests only.
pub(super) fn test_modules(code: &str) -> Vec<String> {
    let declared = code
        .match_indices("#[cfg(test)]")
        .filter_map(|(at, found)| {
            let after = code[at + found.len()..].trim_start();
            let name = after.strip_prefix("mod ")?.split_once(';')?.0.trim();
            name.chars().all(is_word).then(|| name.to_owned())
        });
    declared.collect()
}

/// What the `use` declarations of the code import.
pub(super) fn imports_of(code: &str) -> Vec<Import> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices("use ") {
        if code[..at].ends_with(is_word) {
            continue;
        }
        if let Some((tree, _)) = code[at + 4..].split_once(';') {
            expand(tree.trim(), &[], &mut found);
        }
    }
    found
}

/// Takes a tree of `use` apart: `a::{b, c::D as E}`.
fn expand(tree: &str, before: &[String], found: &mut Vec<Import>) {
    let tree = tree.trim();
    if let Some(list) = tree.strip_prefix('{') {
        let (mut depth, mut from) = (0, 0);
        let list = list.trim_end().trim_end_matches('}');
        // The last brace closes this list unless an inner one was taken with it.
        let open = list.matches('{').count() - list.matches('}').count();
        let list = format!("{list}{}", "}".repeat(open));
        for (at, next) in list.char_indices() {
            match next {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    expand(&list[from..at], before, found);
                    from = at + 1;
                }
                _ => {}
            }
        }
        return expand(&list[from..], before, found);
    }
    match tree.split_once("::") {
        _ if tree.is_empty() => {}
        Some((head, rest)) if !head.contains(' ') => {
            let path: Vec<String> = before.iter().cloned().chain([head.to_owned()]).collect();
            expand(rest, &path, found);
        }
        _ => {
            let (last, name) = tree.split_once(" as ").unwrap_or((tree, tree));
            let mut path = before.to_vec();
            let mut name = Some(name.trim().to_owned());
            match last.trim() {
                "*" => name = None,
                "self" if name.as_deref() == Some("self") => name = before.last().cloned(),
                "self" => {}
                last => path.push(last.to_owned()),
            }
            found.push(Import { name, path });
        }
    }
}

/// The paths of more than one segment in the code: `crate::a::B`, `super::c`, `d::E`.
pub(super) fn paths_of(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find(is_word) {
        rest = &rest[at..];
        let mut path = Vec::new();
        loop {
            let end = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            path.push(rest[..end].to_owned());
            rest = &rest[end..];
            match rest.strip_prefix("::") {
                Some(after) if after.starts_with(is_word) => rest = after,
                _ => break,
            }
        }
        if path.len() > 1 {
            found.push(path);
        }
    }
    found
}
