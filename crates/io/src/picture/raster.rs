//! SVG to PNG, without system libraries: resvg draws, and all text is set in
//! Noto Sans (Apache-2.0), which is built in, so that a picture looks the same
//! on every machine.

use std::sync::{Arc, OnceLock};

use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb::Database},
};

use super::PictureError;

/// Draws an SVG document as a PNG image, `scale` pixels for each of its own.
///
/// # Errors
/// [`PictureError::Raster`] when the text is no SVG document, or the image
/// would be empty or larger than memory allows.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), tensegra_io::PictureError> {
/// let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" width="4" height="3"/>"#;
/// let png = tensegra_io::rasterise(svg, 2.0)?;
/// assert_eq!(&png[1..4], b"PNG");
/// # Ok(())
/// # }
/// ```
pub fn rasterise(svg: &str, scale: f64) -> Result<Vec<u8>, PictureError> {
    let failed = |reason: String| PictureError::Raster { reason };
    let tree = parse(svg).map_err(failed)?;
    let size = [tree.size().width(), tree.size().height()].map(|side| f64::from(side) * scale);
    if !size.iter().all(|side| (1.0..=MAX_SIDE).contains(side)) {
        let [width, height] = size;
        return Err(failed(format!(
            "an image of {width} by {height} pixels; sides from 1 to {MAX_SIDE} are possible"
        )));
    }
    let [width, height] = size.map(|side| side.ceil() as u32);
    let mut image = Pixmap::new(width, height)
        .ok_or_else(|| failed(format!("no memory for {width} by {height} pixels")))?;
    let scale = scale as f32;
    let transform = Transform::from_scale(scale, scale);
    resvg::render(&tree, transform, &mut image.as_mut());
    image.encode_png().map_err(|e| failed(e.to_string()))
}

const MAX_SIDE: f64 = 16384.0;

pub(crate) fn parse(svg: &str) -> Result<Tree, String> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let fonts = FONTS.get_or_init(|| {
        let mut fonts = Database::new();
        fonts.load_font_data(ttf_noto_sans::REGULAR.to_vec());
        fonts.set_sans_serif_family("Noto Sans");
        Arc::new(fonts)
    });
    let options = Options {
        fontdb: Arc::clone(fonts),
        font_family: "Noto Sans".to_owned(),
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(|failure| failure.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_svg_is_refused() {
        for (svg, scale) in [
            ("", 1.0),
            ("<svg>", 1.0),
            (
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>"#,
                1e6,
            ),
            (
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"/>"#,
                f64::NAN,
            ),
        ] {
            let result = rasterise(svg, scale);
            assert!(matches!(result, Err(PictureError::Raster { .. })));
        }
    }
}
