//! Reads a text with all that it includes.

use super::findings::{Notes, Severity};
use super::parser::parse;
use super::tree::{Form, Kind, Tree};
use crate::model::Position;

/// How many bytes all files of a reading may have.
pub(super) const MOST_BYTES: usize = 16 << 20;

/// How deep files may include files.
const MOST_DEPTH: usize = 16;

/// How many files a reading may have.
const MOST_FILES: usize = 256;

/// Where included files come from.
///
/// ```
/// use farside_planning::language::{Include, Options, read_model};
/// let files = |path: &str| match path {
///     "models/types.ddl" => Ok("(Define_Type Side (left right))".to_owned()),
///     _ => Err("no such file".to_owned()),
/// };
/// let text = r#"
/// (Include "types.ddl")
/// (Define_Object_Class Arm :state_variables ((State Arm_SV)))
/// (Define_Predicate Hold ((Side ?side)))
/// (Define_Member_Values (Arm Arm_SV) (Hold))
/// "#;
/// let options = Options { include: Some(&files), ..Options::default() };
/// let model = read_model("models/arm.ddl", text, &options).value.expect("it is right");
/// assert_eq!(model.files, ["models/arm.ddl", "models/types.ddl"]);
/// ```
pub trait Include {
    /// The text of a file, whose path is that of the including file's folder with what the
    /// `Include` says.
    ///
    /// # Errors
    ///
    /// Why it cannot be read, in words.
    fn read(&self, path: &str) -> Result<String, String>;
}

impl<F: Fn(&str) -> Result<String, String>> Include for F {
    fn read(&self, path: &str) -> Result<String, String> {
        self(path)
    }
}

/// Reads included files from disk, relative to the folder of the process.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Include for Disk {
    fn read(&self, path: &str) -> Result<String, String> {
        let length = std::fs::metadata(path)
            .map_err(|error| error.to_string())?
            .len();
        if length > MOST_BYTES as u64 {
            return Err(format!("{length} bytes, more than {MOST_BYTES}"));
        }
        std::fs::read_to_string(path).map_err(|error| error.to_string())
    }
}

/// The trees of all files, and their forms in the order in which they are to be read.
#[derive(Debug, Default)]
pub(super) struct Loaded {
    trees: Vec<Tree>,
    forms: Vec<(u32, u32)>,
}

impl Loaded {
    pub(super) fn forms(&self) -> impl Iterator<Item = Form<'_>> {
        let forms = self.forms.iter();
        forms.map(|&(tree, node)| self.trees[tree as usize].form(node))
    }
}

/// Reads a text, and in the place of each `Include` the file that it names, once each.
pub(super) fn load(
    name: &str,
    text: &str,
    strict: bool,
    include: Option<&dyn Include>,
    notes: &mut Notes,
) -> Loaded {
    let mut loader = Loader {
        strict,
        include,
        notes,
        bytes: 0,
        loaded: Loaded::default(),
    };
    loader.take(name, text, None, &mut Vec::new());
    loader.loaded
}

struct Loader<'a> {
    strict: bool,
    include: Option<&'a dyn Include>,
    notes: &'a mut Notes,
    bytes: usize,
    loaded: Loaded,
}

impl Loader<'_> {
    /// Reads a file that is included at some position, within the files `open`.
    fn take(&mut self, name: &str, text: &str, at: Option<Position>, open: &mut Vec<String>) {
        let file = self.notes.files.len() as u32;
        self.notes.files.push(name.to_owned());
        self.loaded.trees.push(Tree::default());
        self.bytes = self.bytes.saturating_add(text.len());
        if self.bytes > MOST_BYTES {
            let at = at.unwrap_or(Position {
                file,
                line: 1,
                column: 1,
            });
            let expected = format!("at most {MOST_BYTES} bytes in all files");
            self.notes.note(
                Severity::Error,
                at,
                expected,
                format!("{} or more", self.bytes),
            );
            return;
        }
        let tree = parse(file, text.to_owned(), self.strict, self.notes);
        open.push(name.to_owned());
        for form in tree.forms() {
            if !form.is_list() {
                self.notes.error(form, "a form, as (Define_Type …)");
            } else if form.is_form("Include") {
                self.include(form, name, open);
            } else {
                self.loaded.forms.push((file, form.node()));
            }
        }
        open.pop();
        self.loaded.trees[file as usize] = tree;
    }

    fn include(&mut self, form: Form, from: &str, open: &mut Vec<String>) {
        let mut parts = form.children().skip(1);
        let (path, more) = (parts.next(), parts.next());
        let Some(text) = path.filter(|path| path.kind() == Kind::Text && more.is_none()) else {
            self.notes.error(form, "(Include \"path\")");
            return;
        };
        let path = join(from, text.word().trim_matches('"'));
        if let Some(start) = open.iter().position(|name| *name == path) {
            let cycle = open[start..].join(" includes ");
            let found = format!("{cycle} includes {path}");
            self.notes
                .refuse(text, "files that do not include themselves", found);
        } else if self.notes.files.contains(&path) {
            // It is there already.
        } else if open.len() == MOST_DEPTH || self.notes.files.len() == MOST_FILES {
            let expected = format!("at most {MOST_FILES} files, {MOST_DEPTH} in one another");
            self.notes.error(text, expected);
        } else {
            let Some(include) = self.include else {
                self.notes
                    .error(text, "no Include: this text is read without files");
                return;
            };
            match include.read(&path) {
                Ok(text) => self.take(&path, &text, Some(form.position()), open),
                Err(why) => self.notes.refuse(text, format!("a file {path}"), why),
            }
        }
    }
}

/// The path of a file that another one names, with `.` and `..` taken out.
fn join(from: &str, path: &str) -> String {
    let folder = from.rfind('/').map_or("", |end| &from[..end]);
    let (rooted, mut parts) = match path.starts_with('/') {
        true => (true, Vec::new()),
        false => (from.starts_with('/'), folder.split('/').collect()),
    };
    parts.retain(|part| !part.is_empty());
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|last| *last != "..") => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    format!("{}{}", if rooted { "/" } else { "" }, parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::join;

    #[test]
    fn paths_are_relative_to_the_including_file() {
        assert_eq!(join("a/b.ddl", "c.ddl"), "a/c.ddl");
        assert_eq!(join("b.ddl", "./c/../d.ddl"), "d.ddl");
        assert_eq!(join("/a/b.ddl", "../c.ddl"), "/c.ddl");
        assert_eq!(join("a/b.ddl", "../../c.ddl"), "../c.ddl");
        assert_eq!(join("a/b.ddl", "/c.ddl"), "/c.ddl");
    }
}
