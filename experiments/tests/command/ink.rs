//! Figures as programs draw them that are no browsers: papers, slides, file managers.

use std::collections::BTreeMap;
use std::sync::Arc;

use resvg::usvg::fontdb::Database;
use resvg::{tiny_skia, usvg};

const FONTS: [&[u8]; 2] = [
    include_bytes!("../../src/export/fonts/Roboto-Regular.ttf"),
    include_bytes!("../../src/export/fonts/Roboto-Bold.ttf"),
];

/// How a figure looks.
#[derive(Debug)]
pub(crate) struct Look {
    /// The colour of most of it.
    paper: [u8; 3],
    /// The share of the rest.
    ink: f64,
    /// How many colours there are, of those that a hundred-thousandth of it has.
    colours: usize,
    /// The share that is black, or nearly.
    black: f64,
}

/// Draws a figure with resvg. Without fonts it has no texts.
fn look(svg: &str, with_fonts: bool) -> Look {
    let mut fonts = Database::new();
    if with_fonts {
        for font in FONTS {
            fonts.load_font_data(font.to_vec());
        }
        fonts.set_sans_serif_family("Roboto");
    }
    let options = usvg::Options {
        fontdb: Arc::new(fonts),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(svg, &options).expect("it is SVG");
    let size = tree.size().to_int_size();
    let mut pixels = tiny_skia::Pixmap::new(size.width(), size.height()).expect("it has a size");
    resvg::render(&tree, tiny_skia::Transform::default(), &mut pixels.as_mut());
    let mut counts = BTreeMap::<[u8; 3], usize>::new();
    for pixel in pixels.pixels() {
        let colour = [pixel.red(), pixel.green(), pixel.blue()];
        assert_eq!(pixel.alpha(), 255, "it has no paper");
        *counts.entry(colour).or_default() += 1;
    }
    let all = pixels.pixels().len() as f64;
    let (paper, most) = counts
        .iter()
        .max_by_key(|(_, count)| **count)
        .expect("pixels");
    let black = counts
        .iter()
        .filter(|(colour, _)| colour.iter().all(|part| *part < 40));
    let black: usize = black.map(|(_, count)| *count).sum();
    Look {
        paper: *paper,
        ink: 1.0 - *most as f64 / all,
        colours: counts
            .values()
            .filter(|count| **count as f64 > 1e-5 * all)
            .count(),
        black: black as f64 / all,
    }
}

/// Checks that a figure is ink on white paper, in more than one colour, with texts.
pub(crate) fn assert_readable(name: &str, svg: &str) {
    let seen = look(svg, true);
    assert_eq!(seen.paper, [255; 3], "{name}: {seen:?}");
    assert!((0.01..0.6).contains(&seen.ink), "{name}: {seen:?}");
    assert!(seen.black < 0.08, "{name}: {seen:?}");
    assert!(seen.colours > 20, "{name}: {seen:?}");
    let mute = look(svg, false);
    assert!(
        seen.ink > mute.ink + 0.003,
        "{name} has no texts: {seen:?}, {mute:?}"
    );
}
