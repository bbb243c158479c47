//! What is written, and what is said where it cannot be.

use super::*;

#[cfg(not(feature = "export"))]
#[test]
fn without_renderers_it_is_said_what_to_do() {
    assert!(check(FigureFormat::Svg).is_ok());
    assert_eq!(
        export("<svg/>", FigureFormat::Svg).unwrap().bytes,
        b"<svg/>"
    );
    for kind in [FigureFormat::Pdf, FigureFormat::Png] {
        let error = export("<svg/>", kind).unwrap_err().to_string();
        assert!(
            error.contains("--features farside-experiments/export"),
            "{error}"
        );
        let other = format!("rsvg-convert --format {} ", kind.ending());
        assert!(error.contains(&other), "{error}");
    }
}

#[cfg(feature = "export")]
mod rendered {
    use super::*;

    fn figure(text: &str) -> String {
        let figure = farside_actors::figure::Figure {
            file: "f.svg".to_owned(),
            title: "a figure".to_owned(),
            description: String::new(),
            width: 200.0,
            height: 40.0,
            body: maud::html! { text class="label" x="10" y="20" { (text) } },
            facet: String::new(),
            style: "",
        };
        figure.standalone()
    }

    #[test]
    fn a_pdf_holds_its_fonts_and_a_png_its_pixels() {
        let svg = figure("rate (%) ≥ 0.3 − ½ Δ");
        let pdf = export(&svg, FigureFormat::Pdf).unwrap();
        assert!(pdf.bytes.starts_with(b"%PDF-"));
        let names_font = pdf.bytes.windows(6).any(|part| part == b"Roboto");
        assert!(names_font, "the fonts are not in it");
        assert!(pdf.missing.is_empty(), "{:?}", pdf.missing);
        let png = export(&svg, FigureFormat::Png).unwrap().bytes;
        // Width and height follow the signature and the first chunk's head.
        assert_eq!(png[..8], *b"\x89PNG\r\n\x1a\n");
        assert_eq!(png[16..24], [0, 0, 2, 88, 0, 0, 0, 120]);
        assert_eq!(png, export(&svg, FigureFormat::Png).unwrap().bytes);
    }

    #[test]
    fn letters_that_no_font_has_are_named() {
        // Of a private area, for which no font is likely to have anything.
        let exported = export(&figure("a \u{f0f00} b"), FigureFormat::Png).unwrap();
        assert_eq!(exported.missing, ['\u{f0f00}']);
    }
}
