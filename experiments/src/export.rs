//! Figures as PDF and PNG, for papers and slides.
//!
//! SVG is what figures are; this turns it into what LaTeX and slides take. The renderers are a
//! feature of the crate, `export`, that is off unless asked for. Without it the command says how to
//! get it.
//!
//! Texts are set in Roboto, which is part of the command: so a figure looks the same on every
//! machine, and has its texts on one without fonts. Only letters that Roboto lacks are taken from the
//! fonts of the machine; those that no font has are named, since they would be missing without a
//! word.

use std::fmt;

use thiserror::Error;

/// What a figure is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum FigureFormat {
    /// As it is drawn: for browsers and the web.
    Svg,
    /// For papers: vectors, with the fonts in it
    Pdf,
    /// For slides: pixels, three for each of the figure's own
    Png,
}

impl FigureFormat {
    /// The ending of files of this kind.
    pub fn ending(self) -> &'static str {
        match self {
            FigureFormat::Svg => "svg",
            FigureFormat::Pdf => "pdf",
            FigureFormat::Png => "png",
        }
    }
}

impl fmt::Display for FigureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.ending().to_uppercase())
    }
}

/// Why a figure is not turned into another kind.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The feature is off.
    #[error(
        "this farside writes figures as SVG alone: for {0}, build it with `cargo build --release \
         --features farside-experiments/export`, or turn an SVG into it with another program, as \
         `rsvg-convert --format {ending} FIGURE.svg --output FIGURE.{ending}` does",
        ending = .0.ending()
    )]
    NotBuiltIn(FigureFormat),
    /// The renderer does not take it.
    #[error("the figure cannot be turned into {kind}: {message}")]
    NotDrawn {
        /// Into what.
        kind: FigureFormat,
        /// What the renderer says.
        message: String,
    },
}

/// A figure in another kind.
#[derive(Debug)]
pub struct Exported {
    /// The file's bytes.
    pub bytes: Vec<u8>,
    /// Letters that no font at hand has: they are not in the picture.
    pub missing: Vec<char>,
}

/// Checks that figures can be written as this kind, before anything is drawn.
///
/// # Errors
/// If the feature `export` is off, and the kind is not SVG.
pub fn check(kind: FigureFormat) -> Result<(), ExportError> {
    match kind {
        FigureFormat::Pdf | FigureFormat::Png if !cfg!(feature = "export") => {
            Err(ExportError::NotBuiltIn(kind))
        }
        _ => Ok(()),
    }
}

/// The kinds of files that are asked for: the first, and `more`, each once. All are checked.
///
/// # Errors
/// Those of [`check`].
pub fn kinds(first: FigureFormat, more: &[FigureFormat]) -> Result<Vec<FigureFormat>, ExportError> {
    let mut kinds = vec![first];
    for kind in more {
        if !kinds.contains(kind) {
            kinds.push(*kind);
        }
    }
    kinds.iter().try_for_each(|kind| check(*kind))?;
    Ok(kinds)
}

/// Without the feature `export`, only what is an SVG already.
///
/// # Errors
/// For all other kinds.
#[cfg(not(feature = "export"))]
pub fn export(svg: &str, kind: FigureFormat) -> Result<Exported, ExportError> {
    check(kind)?;
    let bytes = svg.as_bytes().to_vec();
    let missing = Vec::new();
    Ok(Exported { bytes, missing })
}

#[cfg(feature = "export")]
pub use renderers::export;

#[cfg(feature = "export")]
mod renderers {
    use super::{ExportError, Exported, FigureFormat, fonts};
    use resvg::{tiny_skia, usvg};

    /// How many pixels of a PNG there are for one of the figure.
    const PNG_SCALE: f32 = 3.0;

    /// Turns a figure, as SVG, into another kind. The same figure gives the same bytes, as long as
    /// it takes no letters from the machine's fonts.
    ///
    /// # Errors
    /// If the renderer does not take it.
    pub fn export(svg: &str, kind: FigureFormat) -> Result<Exported, ExportError> {
        let drawn = |message: String| ExportError::NotDrawn { kind, message };
        if kind == FigureFormat::Svg {
            let bytes = svg.as_bytes().to_vec();
            let missing = Vec::new();
            return Ok(Exported { bytes, missing });
        }
        let (options, missing) = fonts::options(svg);
        let tree = usvg::Tree::from_str(svg, &options).map_err(|error| drawn(error.to_string()))?;
        let bytes = match kind {
            FigureFormat::Pdf => {
                let page = svg2pdf::PageOptions::default();
                svg2pdf::to_pdf(&tree, svg2pdf::ConversionOptions::default(), page)
                    .map_err(|error| drawn(error.to_string()))?
            }
            FigureFormat::Svg | FigureFormat::Png => {
                let size = tree.size().to_int_size();
                let side = |pixels: u32| (pixels as f32 * PNG_SCALE) as u32;
                let mut pixels = tiny_skia::Pixmap::new(side(size.width()), side(size.height()))
                    .ok_or_else(|| drawn("it has no size".to_owned()))?;
                let scale = tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE);
                resvg::render(&tree, scale, &mut pixels.as_mut());
                pixels
                    .encode_png()
                    .map_err(|error| drawn(error.to_string()))?
            }
        };
        Ok(Exported { bytes, missing })
    }
}

#[cfg(feature = "export")]
mod fonts;

#[cfg(test)]
mod tests;
