//! The fonts that figures are set in.

use std::collections::BTreeSet;
use std::sync::Arc;

use resvg::usvg::{self, fontdb};

const REGULAR: &[u8] = include_bytes!("fonts/Roboto-Regular.ttf");
const BOLD: &[u8] = include_bytes!("fonts/Roboto-Bold.ttf");
const FAMILY: &str = "Roboto";

/// What a figure is read with: Roboto, and the machine's fonts where it has letters that Roboto
/// lacks. Beside it, the letters that none has.
pub(super) fn options(svg: &str) -> (usvg::Options<'static>, Vec<char>) {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(REGULAR.to_vec());
    fonts.load_font_data(BOLD.to_vec());
    let mut missing = missing(svg, &fonts);
    if !missing.is_empty() {
        fonts.load_system_fonts();
        let lacking: String = missing.iter().collect();
        missing = self::missing(&lacking, &fonts);
    }
    fonts.set_sans_serif_family(FAMILY);
    let options = usvg::Options {
        font_family: FAMILY.to_owned(),
        fontdb: Arc::new(fonts),
        ..usvg::Options::default()
    };
    (options, missing)
}

/// The letters of a text that no font has, each once. Markup counts as text: it is ASCII, which
/// every font has.
fn missing(text: &str, fonts: &fontdb::Database) -> Vec<char> {
    let mut letters: BTreeSet<char> = text.chars().filter(|c| !c.is_control()).collect();
    for face in fonts.faces() {
        fonts.with_face_data(face.id, |data, index| {
            if let Ok(face) = ttf_parser::Face::parse(data, index) {
                letters.retain(|letter| face.glyph_index(*letter).is_none());
            }
        });
        if letters.is_empty() {
            break;
        }
    }
    letters.into_iter().collect()
}
