//! No circles: files that import each other can only be understood, tested and moved together.
//!
//! Two circles are none of that kind: a module with its own parts, and two actors that talk to each
//! other, which are listed by name. Re-exports are followed to where a thing is declared, so that a
//! `pub use` hides nothing. What is built for tests only may import whatever it tests with.

mod source;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use self::source::{Import, declares, imports_of, paths_of, test_modules, without_tests};
use super::{code_of, root, sources};

/// The folders of the crates whose files are checked.
const CRATES: [&str; 11] = [
    "src",
    "worlds/src",
    "logs/src",
    "actors/src",
    "actors/idea/src",
    "actors/misus/src",
    "actors/network/src",
    "actors/planning/src",
    "actors/traffic/src",
    "experiments/src",
    "tests/src",
];

/// Files of actors that talk to each other, each knowing the other's address or messages: which,
/// and why neither can do without the other.
const ACTORS_THAT_TALK: [(&[&str], &str); 0] = [];

/// Circles that are yet to be opened. Whoever moves these files opens them and takes them out;
/// nothing is added.
const KNOWN: [&[&str]; 0] = [];

/// One crate's files as modules: the path from the crate's root, without the root itself.
type Module = Vec<String>;

struct File {
    path: String,
    code: String,
    imports: Vec<Import>,
}

/// The files of one crate, by module.
struct Crate {
    files: BTreeMap<Module, File>,
}

/// Which file imports from which, by path.
type Graph = BTreeMap<String, BTreeSet<String>>;

impl Crate {
    /// The crate whose files, as (path from the root, source), lie in `folder`.
    fn new(folder: &str, sources: &[(String, String)]) -> Self {
        let mut files = BTreeMap::new();
        for (path, source) in sources {
            let Some(inside) = path.strip_prefix(folder).and_then(|p| p.strip_prefix('/')) else {
                continue;
            };
            let inside = inside.trim_end_matches(".rs");
            if inside == "main" || inside.starts_with("bin/") {
                continue;
            }
            let module: Module = match inside {
                "lib" => Vec::new(),
                _ => inside.split('/').map(str::to_owned).collect(),
            };
            let code = without_tests(&code_of(source));
            let imports = imports_of(&code);
            let path = path.clone();
            files.insert(
                module,
                File {
                    path,
                    code,
                    imports,
                },
            );
        }
        let mut crate_ = Crate { files };
        crate_.drop_test_files(sources);
        crate_
    }

    /// Takes out the files that are there for tests only, `#[cfg(test)] mod tests;`, and their
    /// parts.
    fn drop_test_files(&mut self, sources: &[(String, String)]) {
        let mut dropped: Vec<Module> = Vec::new();
        for (module, file) in &self.files {
            let source = sources.iter().find(|(path, _)| *path == file.path);
            let code = source
                .map(|(_, source)| code_of(source))
                .unwrap_or_default();
            for name in test_modules(&code) {
                dropped.push(module.iter().cloned().chain([name]).collect());
            }
        }
        self.files
            .retain(|module, _| !dropped.iter().any(|root| module.starts_with(root)));
    }

    /// Adds which of this crate's files imports from which.
    fn link(&self, graph: &mut Graph) {
        for (module, file) in &self.files {
            let edges = graph.entry(file.path.clone()).or_default();
            let imported = file.imports.iter().map(|import| import.path.clone());
            for path in imported.chain(paths_of(&file.code)) {
                let target = self
                    .resolve(module, &path, 0)
                    .and_then(|found| self.files.get(&found));
                edges.extend(target.map(|target| target.path.clone()));
            }
            edges.remove(&file.path);
        }
    }

    /// The module that declares what `path` names in `module`; none if it is another crate's.
    fn resolve(&self, module: &Module, path: &[String], depth: u32) -> Option<Module> {
        // Re-exports in a circle name nothing; rustc says so in its own words.
        if depth > 16 {
            return None;
        }
        let (first, mut rest) = path.split_first()?;
        let mut at = match first.as_str() {
            "crate" => Module::new(),
            "self" => module.clone(),
            "super" => module.split_last()?.1.to_vec(),
            _ => {
                rest = path;
                module.clone()
            }
        };
        let mut is_local = rest.len() < path.len();
        while let Some((segment, after)) = rest.split_first() {
            if segment == "super" {
                at.pop()?;
                rest = after;
                continue;
            }
            let child: Module = at.iter().cloned().chain([segment.clone()]).collect();
            if self.files.contains_key(&child) {
                (at, rest, is_local) = (child, after, true);
                continue;
            }
            let file = self.files.get(&at)?;
            let named = |import: &&Import| import.name.as_ref() == Some(segment);
            if let Some(import) = file.imports.iter().find(named) {
                let path: Vec<String> = import.path.iter().chain(after).cloned().collect();
                // `use name::...` of another crate, under the very name asked for, ends here.
                return match import.path.first() == Some(segment) {
                    true => None,
                    false => self.resolve(&at, &path, depth + 1),
                };
            }
            if declares(&file.code, segment) {
                return Some(at);
            }
            let globs = file.imports.iter().filter(|import| import.name.is_none());
            let found = globs.filter_map(|glob| {
                let path: Vec<String> = glob.path.iter().chain(rest).cloned().collect();
                let from = self.resolve(&at, &glob.path, depth + 1)?;
                let target = self.resolve(&at, &path, depth + 1)?;
                (target != from || declares(&self.files.get(&target)?.code, segment))
                    .then_some(target)
            });
            return found.into_iter().next().or(is_local.then_some(at));
        }
        is_local.then_some(at)
    }
}

/// The files that `from` leads to, itself only if in a circle.
fn reach(graph: &Graph, from: &str) -> BTreeSet<String> {
    let mut seen = BTreeSet::new();
    let mut next: Vec<&String> = graph[from].iter().collect();
    while let Some(file) = next.pop() {
        if seen.insert(file.clone()) {
            next.extend(&graph[file]);
        }
    }
    seen
}

/// The groups of files each of which leads to all others of its group.
fn groups(graph: &Graph) -> Vec<BTreeSet<String>> {
    let reached: BTreeMap<&String, _> = graph
        .keys()
        .map(|file| (file, reach(graph, file)))
        .collect();
    let mut found: Vec<BTreeSet<String>> = Vec::new();
    for (file, leads_to) in &reached {
        if leads_to.contains(*file) && !found.iter().any(|group| group.contains(*file)) {
            let back = leads_to
                .iter()
                .filter(|other| reached[other].contains(*file));
            found.push(back.cloned().collect());
        }
    }
    found
}

/// True if one file of the group is the module of which all others are parts. The root of a crate,
/// of which everything is a part, is no such file.
fn is_module_with_parts(group: &BTreeSet<String>) -> bool {
    group.iter().any(|file| {
        let folder = format!("{}/", file.trim_end_matches(".rs"));
        group
            .iter()
            .all(|other| other == file || other.starts_with(&folder))
    })
}

/// A shortest circle of the group through `start`, as the files on it, `start` at both ends.
fn circle<'a>(graph: &'a Graph, group: &BTreeSet<String>, start: &'a String) -> Vec<&'a str> {
    let mut came_from: BTreeMap<&String, &String> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(file) = queue.pop_front() {
        for next in graph[file].iter().filter(|next| group.contains(*next)) {
            if next == start {
                let before = |at: &&'a String| came_from.get(*at).copied();
                let way = std::iter::successors(Some(file), before).map(String::as_str);
                let mut way: Vec<&str> = std::iter::once(start.as_str()).chain(way).collect();
                if file != start && way.last() != Some(&start.as_str()) {
                    way.push(start);
                }
                way.reverse();
                return way;
            }
            if !came_from.contains_key(next) {
                came_from.insert(next, file);
                queue.push_back(next);
            }
        }
    }
    Vec::new()
}

/// A shortest circle in the group that leaves a module, as text.
fn example(graph: &Graph, group: &BTreeSet<String>) -> String {
    let inside = |way: &Vec<&str>| {
        is_module_with_parts(&way.iter().map(|file| (*file).to_owned()).collect())
    };
    let files = graph.keys().filter(|file| group.contains(*file));
    let circles = files.map(|file| circle(graph, group, file));
    let least = circles.min_by_key(|way| (inside(way), way.len()));
    least.unwrap_or_default().join(" -> ")
}

/// What is wrong with a graph of files: circles that nobody allowed, and allowances of none.
fn misplaced_circles(graph: &Graph, allowed: &[&[&str]]) -> Vec<String> {
    let groups: Vec<_> = groups(graph)
        .into_iter()
        .filter(|g| !is_module_with_parts(g))
        .collect();
    let mut found = Vec::new();
    for group in &groups {
        if !allowed
            .iter()
            .any(|files| group.iter().all(|file| files.contains(&file.as_str())))
        {
            let files: Vec<&str> = group.iter().map(String::as_str).collect();
            let (way, files) = (example(graph, group), files.join(", "));
            found.push(format!("a circle: {way} (it holds together {files})"));
        }
    }
    for files in allowed {
        let is_there = |file: &&str| groups.iter().any(|group| group.contains(*file));
        if !files.iter().any(is_there) {
            let files = files.join(", ");
            found.push(format!(
                "there is no circle of {files} any more: take it out of the list"
            ));
        }
    }
    found
}

fn graph_of(folder: &str, sources: &[(String, String)]) -> Graph {
    let mut graph = Graph::new();
    Crate::new(folder, sources).link(&mut graph);
    graph
}

#[test]
fn files_import_each_other_in_no_circle() {
    let mut files = Vec::new();
    sources(&root(), &mut files);
    let mut graph = Graph::new();
    for folder in CRATES {
        let before = graph.len();
        Crate::new(folder, &files).link(&mut graph);
        assert!(graph.len() > before, "{folder} has no files");
    }
    let talking = ACTORS_THAT_TALK.iter().map(|(files, _)| *files);
    let allowed: Vec<&[&str]> = talking.chain(KNOWN).collect();
    let found = misplaced_circles(&graph, &allowed);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The circles of a crate with these files.
fn circles_of(files: &[(&str, &str)], allowed: &[&[&str]]) -> Vec<String> {
    let files: Vec<_> = files
        .iter()
        .map(|(p, s)| ((*p).to_owned(), (*s).to_owned()))
        .collect();
    misplaced_circles(&graph_of("src", &files), allowed)
}

#[test]
fn a_circle_is_found() {
    let circle =
        ["a circle: src/a.rs -> src/b.rs -> src/a.rs (it holds together src/a.rs, src/b.rs)"];
    for (a, b) in [
        ("use crate::b::B;", "use crate::a::A;"),
        ("use super::b;", "fn f() { crate::a::g() }"),
        ("use crate::{b::{self, B as C}};", "use super::a::*;"),
        ("impl crate::b::B for u8 {}", "use crate::A;"),
        (
            "use crate::A; use crate::b::{c::{D}, E};",
            "pub(crate) use crate::a::{A};",
        ),
    ] {
        let lib = "mod a; mod b; pub use a::A; pub use b::B;";
        let a = format!("{a}\npub struct A;");
        let b = format!("{b}\npub struct B;");
        let found = circles_of(
            &[("src/lib.rs", lib), ("src/a.rs", &a), ("src/b.rs", &b)],
            &[],
        );
        assert_eq!(found, circle, "{a} {b}");
        let files = [("src/lib.rs", lib), ("src/a.rs", &a), ("src/b.rs", &b)];
        assert_eq!(circles_of(&files, &[&["src/a.rs", "src/b.rs"]]), [""; 0]);
    }
}

#[test]
fn a_module_and_its_parts_are_no_circle_and_a_way_through_a_part_is() {
    let parent = ("src/a.rs", "mod b; use b::B; pub struct A;");
    let part = ("src/a/b.rs", "use super::A; use super::c::C; pub struct B;");
    let other = (
        "src/a/c.rs",
        "use crate::a::b::B; use crate::a::A; pub struct C;",
    );
    assert_eq!(circles_of(&[parent, part], &[]), [""; 0]);
    assert_eq!(circles_of(&[parent, part, other], &[]), [""; 0]);
    let sibling = ("src/d.rs", "use crate::a::A;");
    let part = ("src/a/b.rs", "use crate::d::D;");
    let found = circles_of(&[parent, part, sibling], &[]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].contains("src/a.rs, src/a/b.rs, src/d.rs"),
        "{found:?}"
    );
    // The root holds everything, and so excuses nothing.
    let root = ("src/lib.rs", "mod a; use a::A; pub struct Own;");
    let child = ("src/a.rs", "use crate::Own; pub struct A;");
    assert_eq!(circles_of(&[root, child], &[]).len(), 1);
}

#[test]
fn what_makes_no_circle_is_left_alone() {
    for (a, b) in [
        ("use crate::b::B;", "// use crate::a::A;"),
        (
            "use crate::b::B;",
            "#[cfg(test)] mod tests { use crate::a::A; }",
        ),
        ("use crate::b::B;", "use a::A;"),
        ("use crate::b::B;", "fn f() { let text = \"crate::a::A\"; }"),
        ("#[cfg(test)]\nmod tests;", "use crate::a::A;"),
    ] {
        let tests = ("src/a/tests.rs", "use crate::b::B;");
        let found = circles_of(&[("src/a.rs", a), ("src/b.rs", b), tests], &[]);
        assert_eq!(found, [""; 0], "{a} {b}");
    }
    let found = circles_of(
        &[("src/a.rs", ""), ("src/b.rs", "")],
        &[&["src/a.rs", "src/b.rs"]],
    );
    let stale = "there is no circle of src/a.rs, src/b.rs any more: take it out of the list";
    assert_eq!(found, [stale]);
}
