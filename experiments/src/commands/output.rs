//! Files that commands write: never over what the same command reads, nor over what is there and of
//! another kind.

use std::fs::Metadata;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use farside_actors::figure::Figure;
use farside_logs::refuse_input;

use super::CommandError;
use crate::export::{self, FigureFormat};

/// What a file is, by how all files of its kind that Farside writes begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// A figure: all are alike up to their size.
    Svg,
    /// A report's page: all are alike up to the title.
    Page,
    /// A page of one run or of two: all are alike up to the title.
    View,
    /// A table with a header: one of its kind starts with the same column.
    Table,
    /// Results of tests in XML: all are alike up to the name.
    Junit,
    /// A figure for papers.
    Pdf,
    /// A figure for slides.
    Png,
    /// A plan in JSON: all are alike up to the version of their format.
    Plan,
    /// A scenario that was made small: all are alike up to who did it.
    Small,
    /// What there is to plan: all are alike up to the first point, in the version of their format.
    Problem,
    /// A sequence chart for Mermaid.
    Mermaid,
    /// A sequence chart for PlantUML.
    Plantuml,
    /// A graph for Graphviz.
    Dot,
}

impl Format {
    /// How these bytes and all others of their kind begin.
    fn beginning(self, bytes: &[u8]) -> &[u8] {
        let ends_with: &[u8] = match self {
            Format::Svg => b"viewBox=",
            Format::Page | Format::View => b"<title>",
            Format::Table => b",",
            Format::Junit => b"name=",
            Format::Plan => b"/",
            Format::Small => b"by ",
            Format::Problem => b".",
            Format::Mermaid => b":",
            Format::Plantuml => b"title",
            Format::Dot => b"{",
            Format::Pdf => return &bytes[..bytes.len().min(5)],
            Format::Png => return &bytes[..bytes.len().min(8)],
        };
        let mut places = bytes.windows(ends_with.len());
        let end = places.position(|place| place == ends_with);
        &bytes[..end.unwrap_or(bytes.len())]
    }

    fn name(self) -> &'static str {
        match self {
            Format::Svg | Format::Pdf | Format::Png => "figure",
            Format::Page => "report",
            Format::View => "page of a run",
            Format::Table => "table of this kind",
            Format::Junit => "JUnit file",
            Format::Plan => "plan",
            Format::Small => "scenario that was made small",
            Format::Problem => "problem of this kind",
            Format::Mermaid | Format::Plantuml | Format::Dot => "chart of this kind",
        }
    }
}

/// That a command may write these files, and print what it prints: none is one of the `inputs`, and no
/// two are one file, by whatever name. To be asked by every command before it opens any of them for
/// writing; a command that only prints has no `outputs`.
///
/// # Errors
/// [`LogError::SameFile`](farside_logs::LogError::SameFile) or [`CommandError::TwoOutputs`].
pub(super) fn spare(inputs: &[PathBuf], outputs: &[PathBuf]) -> Result<(), CommandError> {
    for out in outputs {
        refuse_input(out, inputs)?;
    }
    for (at, out) in outputs.iter().enumerate() {
        let other = outputs[..at].iter().find(|other| are_one(out, other));
        if let Some(other) = other {
            return Err(two_outputs(out, &other.display().to_string()));
        }
    }
    for (stream, name) in [
        (opened(std::io::stdout()), "standard output"),
        (opened(std::io::stderr()), "standard error"),
    ] {
        let Some(stream) = stream.filter(can_lose) else {
            continue;
        };
        // Appended to, a file would be changed while it is read.
        let appended = inputs.iter().find(|input| is_it(input, &stream));
        if let Some(path) = appended {
            let path = path.clone();
            return Err(farside_logs::LogError::SameFile { path }.into());
        }
        if let Some(out) = outputs.iter().find(|out| is_it(out, &stream)) {
            return Err(two_outputs(out, name));
        }
    }
    Ok(())
}

fn two_outputs(out: &Path, other: &str) -> CommandError {
    CommandError::TwoOutputs {
        out: out.to_owned(),
        other: other.to_owned(),
    }
}

/// What a stream of this process leads to.
#[cfg(unix)]
fn opened(stream: impl std::os::fd::AsFd) -> Option<Metadata> {
    let stream = stream.as_fd().try_clone_to_owned().ok()?;
    std::fs::File::from(stream).metadata().ok()
}

#[cfg(not(unix))]
fn opened<T>(_stream: T) -> Option<Metadata> {
    None
}

/// False for devices, which hold nothing and take what comes.
#[cfg(unix)]
fn can_lose(found: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    found.is_file() || found.file_type().is_fifo() || found.file_type().is_socket()
}

#[cfg(not(unix))]
fn can_lose(found: &Metadata) -> bool {
    found.is_file()
}

/// Whether a path leads to this file.
#[cfg(unix)]
fn is_it(path: &Path, file: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    let found = std::fs::metadata(path);
    found.is_ok_and(|found| (found.dev(), found.ino()) == (file.dev(), file.ino()))
}

#[cfg(not(unix))]
fn is_it(_path: &Path, _file: &Metadata) -> bool {
    false
}

/// Whether two paths lead to one file, or would once it is there.
fn are_one(one: &Path, other: &Path) -> bool {
    match (std::fs::metadata(one), std::fs::metadata(other)) {
        (Ok(_), Ok(found)) if is_it(one, &found) => can_lose(&found),
        (Ok(found), Ok(_)) => can_lose(&found) && place(one) == place(other),
        _ => place(one) == place(other),
    }
}

/// Where a file is or would be made: symbolic links are followed, also those to nothing yet.
fn place(path: &Path) -> PathBuf {
    /// As far as systems follow them.
    const LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        let Ok(target) = std::fs::read_link(&path) else {
            break;
        };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize();
    match (folder, path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path,
    }
}

/// Writes a text, and says where. A page keeps no control characters, for which HTML has no
/// place; figures have none.
///
/// # Errors
/// If the file is one of the inputs by any name, is there and of another kind, or cannot be written.
pub(super) fn write(
    path: PathBuf,
    text: &str,
    format: Format,
    inputs: &[PathBuf],
) -> Result<String, CommandError> {
    let is_text = |letter: char| !letter.is_control() || matches!(letter, '\n' | '\t');
    let cleaned: String;
    let text = match format {
        Format::Page if !text.chars().all(is_text) => {
            cleaned = text.chars().filter(|letter| is_text(*letter)).collect();
            &cleaned
        }
        _ => text,
    };
    write_bytes(path, text.as_bytes(), format, inputs)
}

/// The same for what is no text.
///
/// # Errors
/// Those of [`write`].
pub(super) fn write_bytes(
    path: PathBuf,
    bytes: &[u8],
    format: Format,
    inputs: &[PathBuf],
) -> Result<String, CommandError> {
    may_write(&path, bytes, format, inputs)?;
    match std::fs::write(&path, bytes) {
        Ok(()) => Ok(path.display().to_string()),
        Err(source) => Err(CommandError::Write { path, source }),
    }
}

/// That a file may be written: it is none of the inputs by any name, and of the same kind if it is
/// there. `bytes` begin as what is to be written.
///
/// # Errors
/// If it may not, or cannot be made.
pub(super) fn may_write(
    path: &Path,
    bytes: &[u8],
    format: Format,
    inputs: &[PathBuf],
) -> Result<(), CommandError> {
    refuse_input(path, inputs)?;
    may_be_made(path)?;
    match is_in_the_way(path, format.beginning(bytes)) {
        true => Err(CommandError::InTheWay {
            path: path.to_owned(),
            what: format.name(),
        }),
        false => Ok(()),
    }
}

/// That a file can be where `path` leads: no folder is in the way, and there is one to make it in. To be asked
/// before what takes long.
///
/// # Errors
/// If it cannot.
pub(super) fn may_be_made(path: &Path) -> Result<(), CommandError> {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let kind = match folder {
        _ if path.is_dir() => ErrorKind::IsADirectory,
        Some(folder) if !folder.exists() => ErrorKind::NotFound,
        Some(folder) if !folder.is_dir() => ErrorKind::NotADirectory,
        _ => return Ok(()),
    };
    Err(CommandError::Write {
        path: path.to_owned(),
        source: kind.into(),
    })
}

/// Writes a file that is there once it is whole: a reader never sees a part of it.
///
/// # Errors
/// Those of [`may_write`], and if it cannot be written.
pub(super) fn write_whole(
    path: &Path,
    bytes: &[u8],
    format: Format,
    inputs: &[PathBuf],
) -> Result<(), CommandError> {
    may_write(path, bytes, format, inputs)?;
    replace(path, bytes)
}

/// Puts bytes in the place of a file, all at once: they are written beside it, and then renamed. A
/// device or a pipe is written to as it is.
///
/// # Errors
/// If it cannot be written: the file is as it was.
pub(super) fn replace(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    let failed = |source| CommandError::Write {
        path: path.to_owned(),
        source,
    };
    // What a link leads to is replaced, and not the link.
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let found = std::fs::metadata(&target).ok();
    if found.as_ref().is_some_and(|found| !found.is_file()) {
        return std::fs::write(&target, bytes).map_err(failed);
    }
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let beside = target.with_file_name(name);
    let written = std::fs::File::create_new(&beside).and_then(|mut file| {
        file.write_all(bytes)?;
        match found {
            Some(found) => file.set_permissions(found.permissions()),
            None => Ok(()),
        }
    });
    let done = written.and_then(|()| std::fs::rename(&beside, &target));
    done.map_err(|error| {
        // What is left beside it is of no use; that it cannot be removed changes nothing.
        let _ = std::fs::remove_file(&beside);
        failed(error)
    })
}

/// Writes a figure as one of the kinds that there are, and says where. What the file is lacking, as
/// letters of which no font is at hand, is said on stderr.
///
/// # Errors
/// Those of [`write`], and if the figure cannot be turned into that kind.
pub(super) fn write_figure(
    path: PathBuf,
    figure: &Figure,
    kind: FigureFormat,
    inputs: &[PathBuf],
) -> Result<String, CommandError> {
    let svg = figure.standalone();
    let format = match kind {
        FigureFormat::Svg => return write(path, &svg, Format::Svg, inputs),
        FigureFormat::Pdf => Format::Pdf,
        FigureFormat::Png => Format::Png,
    };
    let exported = export::export(&svg, kind)?;
    if !exported.missing.is_empty() {
        let letters: String = exported.missing.iter().collect();
        tracing::warn!(
            "{}: no font on this machine has {letters:?}, which {kind} lacks: install one that has \
             (fc-list shows which there are), or use the SVG",
            path.display()
        );
    }
    write_bytes(path, &exported.bytes, format, inputs)
}

/// True if there is a file that does not begin like this. Devices and pipes hold nothing that could
/// be lost, nor do empty files.
fn is_in_the_way(path: &Path, beginning: &[u8]) -> bool {
    let there = std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() > 0);
    if !there {
        return false;
    }
    let mut found = vec![0; beginning.len()];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut found));
    read.is_err() || found != beginning
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whoever has the old file open, or by another name, keeps it: there is no moment at which it is
    /// half a file.
    #[cfg(unix)]
    #[test]
    fn a_file_is_replaced_at_once_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let [file, other, link] = ["file", "other", "link"].map(|name| at.join(name));
        std::fs::write(&file, "old").unwrap();
        std::fs::hard_link(&file, &other).unwrap();
        std::os::unix::fs::symlink("file", &link).unwrap();
        replace(&link, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        assert_eq!(std::fs::read(&other).unwrap(), b"old");
        assert!(link.is_symlink());
        let error = replace(&at.join("no/file"), b"new").unwrap_err();
        assert!(error.to_string().contains("no/file"), "{error}");
        // Where a folder is in the way it stays, and nothing is left beside it.
        std::fs::create_dir(at.join("folder")).unwrap();
        replace(&at.join("folder"), b"new").unwrap_err();
        let names = std::fs::read_dir(at).unwrap().count();
        assert_eq!(names, 4, "file, other, link, folder");
    }
}
