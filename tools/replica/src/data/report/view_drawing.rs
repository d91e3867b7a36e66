//! A top view with scale bar and north arrow.

use image::RgbImage;
use pictures::cloud_picture::round_length;
use std::fmt::Write;

/// Longest scale bar, px.
const MAX_BAR: f64 = 220.0;

/// The picture (a data URI) as a drawing. `scale`: px per m. `has_north`: whether up is north.
pub fn drawing(view: &RgbImage, source: &str, scale: f64, has_north: bool) -> String {
    let (width, height) = view.dimensions();
    let bar_m = round_length(MAX_BAR.min(0.4 * f64::from(width)) / scale);
    let bar = bar_m * scale;
    let bottom = f64::from(height) - 18.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"view\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"15\">\n<image href=\"{source}\" width=\"{width}\" height=\"{height}\"/>\n"
    );
    // Writing to a string cannot fail. White behind black is readable on any color.
    for (color, stroke) in [("white", 7), ("black", 3)] {
        let _ = writeln!(
            svg,
            "<path d=\"M18 {0}v8h{bar:.1}v-8\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{stroke}\"/>",
            bottom - 8.0
        );
    }
    svg.push_str(&label(18.0 + 0.5 * bar, bottom - 8.0, &format!("{bar_m} m")));
    if has_north {
        let x = f64::from(width) - 30.0;
        let _ = writeln!(
            svg,
            "<path d=\"M{x} 14l11 32l-11 -8l-11 8z\" fill=\"black\" stroke=\"white\" stroke-width=\"2\"/>"
        );
        svg.push_str(&label(x, 64.0, "N"));
    }
    svg + "</svg>\n"
}

fn label(x: f64, y: f64, text: &str) -> String {
    format!(
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" style=\"fill:black;stroke:white;stroke-width:4;paint-order:stroke\">\
         {text}</text>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scale_bar_has_its_length_and_the_arrow_only_where_up_is_north() {
        let view = RgbImage::new(1000, 500);
        let svg = drawing(&view, "data:a", 8.0, true);
        // 220 px are 27.5 m.
        assert!(svg.contains(">20 m<") && svg.contains("h160.0v-8") && svg.contains(">N<"), "{svg}");
        assert!(!drawing(&view, "data:a", 8.0, false).contains(">N<"));
    }
}
