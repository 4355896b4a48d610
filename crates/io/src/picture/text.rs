//! How wide a text is, so that pictures can leave room for it.
//!
//! The widths are those of Noto Sans, the font of the PNG pictures. The fonts
//! that viewers of SVG put in its place are no wider.

/// Advance widths of the characters from space to tilde, in thousandths of the
/// font size.
#[rustfmt::skip]
const ASCII: [u16; 95] = [
    259, 269, 408, 645, 571, 831, 731, 225, 299, 299, 550, 571, 268, 321, 268, 372,
    571, 571, 571, 571, 571, 571, 571, 571, 571, 571, 268, 268, 571, 571, 571, 434,
    898, 639, 649, 631, 729, 556, 519, 728, 741, 338, 272, 619, 523, 907, 759, 780,
    604, 780, 622, 548, 556, 730, 600, 930, 585, 565, 571, 329, 372, 329, 571, 443,
    580, 561, 615, 479, 615, 563, 344, 615, 618, 257, 257, 534, 257, 935, 618, 604,
    615, 615, 413, 479, 360, 618, 507, 786, 528, 509, 470, 379, 550, 379, 571,
];
/// For every other character: wide enough for Latin, Greek and signs.
const OTHER: u16 = 700;
const SUPERSCRIPT: f64 = 0.72;

/// A stretch of text on the line or raised above it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run<'a> {
    pub(crate) text: &'a str,
    pub(crate) raised: bool,
}

/// Splits `10^{3} s` into what stands on the line and what is raised.
pub(crate) fn runs(text: &str) -> Vec<Run<'_>> {
    let mut runs = Vec::new();
    let mut rest = text;
    while let Some((before, raised, after)) = rest
        .split_once("^{")
        .and_then(|(before, tail)| Some((before, tail.split_once('}')?)))
        .map(|(before, (raised, after))| (before, raised, after))
    {
        runs.push((before, false));
        runs.push((raised, true));
        rest = after;
    }
    runs.push((rest, false));
    runs.into_iter()
        .filter(|(text, _)| !text.is_empty())
        .map(|(text, raised)| Run { text, raised })
        .collect()
}

/// The size of a raised text beside one of `size`.
pub(crate) fn raised_size(size: f64) -> f64 {
    SUPERSCRIPT * size
}

/// Width of a text set in `size` pixels, in pixels.
pub(crate) fn width(text: &str, size: f64) -> f64 {
    let advance = |c: char| match u32::from(c).checked_sub(32) {
        Some(index) => ASCII.get(index as usize).copied().unwrap_or(OTHER),
        None => 0,
    };
    runs(text)
        .iter()
        .map(|run| {
            let size = if run.raised { raised_size(size) } else { size };
            let thousandths: u32 = run.text.chars().map(|c| u32::from(advance(c))).sum();
            f64::from(thousandths) / 1000.0 * size
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn superscripts_are_split_off() {
        let split: Vec<_> = runs("10^{−3} s")
            .iter()
            .map(|r| (r.text, r.raised))
            .collect();
        assert_eq!(split, [("10", false), ("−3", true), (" s", false)]);
        assert_eq!(runs("a^{b").len(), 1);
        assert!(runs("").is_empty());
    }

    #[test]
    fn widths_add_up() {
        assert_eq!(width("", 10.0), 0.0);
        assert!((width("00", 10.0) - 11.42).abs() < 1e-9);
        assert!(width("10^{2}", 10.0) < width("102", 10.0));
    }
}
