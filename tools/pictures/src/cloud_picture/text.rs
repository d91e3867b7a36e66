//! Letters in pictures.

use font8x8::{BASIC_FONTS, UnicodeFonts};
use image::{Rgb, RgbImage};

/// Magnification of the letters, which are 8 px wide and high.
const ZOOM: u32 = 2;
/// Width and height of a letter, px.
pub const LETTER: u32 = 8 * ZOOM;

/// Width of a text, px.
pub fn width(text: &str) -> u32 {
    text.chars().count() as u32 * LETTER
}

/// Draws a text from its top left corner, clipped to the picture.
pub fn draw(image: &mut RgbImage, [left, top]: [u32; 2], text: &str, color: [u8; 3]) {
    for (letter, x) in text.chars().zip((left..).step_by(LETTER as usize)) {
        let Some(rows) = BASIC_FONTS.get(letter) else { continue };
        for (row, y) in rows.iter().zip((top..).step_by(ZOOM as usize)) {
            for bit in (0..8).filter(|bit| row >> bit & 1 == 1) {
                fill(image, [x + bit * ZOOM, y], [ZOOM, ZOOM], color);
            }
        }
    }
}

/// Fills a rectangle.
pub fn fill(image: &mut RgbImage, [left, top]: [u32; 2], [width, height]: [u32; 2], color: [u8; 3]) {
    for y in top..(top + height).min(image.height()) {
        for x in left..(left + width).min(image.width()) {
            image.put_pixel(x, y, Rgb(color));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_inside_their_width_and_the_picture() {
        let mut image = RgbImage::new(40, 20);
        draw(&mut image, [0, 2], "IL", [255; 3]);
        let lit: Vec<(u32, u32)> =
            image.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 0).map(|(x, y, _)| (x, y)).collect();
        assert!(lit.len() > 40 && lit.iter().all(|(x, y)| *x < width("IL") && (2..18).contains(y)), "{lit:?}");
        draw(&mut image, [35, 15], "W", [255; 3]);
    }
}
