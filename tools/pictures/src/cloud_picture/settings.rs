//! Settings of a picture.

use super::color_by::ColorBy;
use clap::ValueEnum;
use std::str::FromStr;

/// Place that the camera shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    /// Along the path, 0 to 1.
    Share(f64),
    /// At a place: x and y in the frame of the clouds, m.
    Place([f64; 2]),
}

#[derive(Debug, thiserror::Error)]
#[error("must be a share of the path, 0 to 1, or a place X,Y in m")]
pub struct InvalidAt;

impl FromStr for At {
    type Err = InvalidAt;

    fn from_str(text: &str) -> Result<Self, InvalidAt> {
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite()).ok_or(InvalidAt);
        match text.split_once(',') {
            Some((x, y)) => Ok(Self::Place([number(x)?, number(y)?])),
            None => number(text).ok().filter(|share| (0.0..=1.0).contains(share)).map(Self::Share).ok_or(InvalidAt),
        }
    }
}

/// The position of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Viewpoint {
    /// Orthographic from above; north is up.
    Top,
    /// Perspective from behind and above the vehicle.
    Street,
}

/// Background behind the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Background {
    /// Dark blue.
    Dark,
    /// White.
    White,
}

/// Width and height, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

#[derive(Debug, thiserror::Error)]
#[error("must be WIDTHxHEIGHT, each 16 to 8192")]
pub struct InvalidSize;

impl FromStr for PictureSize {
    type Err = InvalidSize;

    fn from_str(text: &str) -> Result<Self, InvalidSize> {
        // 8192 x 8192 needs 2 GB while it is rendered.
        let side = |text: &str| text.parse().ok().filter(|side| (16..=8192).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or(InvalidSize)
    }
}

/// How a picture is made.
#[derive(Clone, Debug)]
pub struct PictureSettings {
    /// Coloring. `None`: color if the clouds have it, else class, else height.
    pub color_by: Option<ColorBy>,
    /// Size of the picture.
    pub size: PictureSize,
    /// Viewpoint of the picture.
    pub viewpoint: Viewpoint,
    /// Place of the picture. The top view at a share of the path shows the whole path.
    pub at: At,
    /// Radius of a view of a place, m.
    pub radius_m: f64,
    /// Wavelength of [`ColorBy::Band`], nm.
    pub band_nm: f64,
    /// Color where no point is.
    pub background: Background,
    /// Without legend, scale bar, north arrow and path.
    pub is_plain: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_and_share_are_told_apart() {
        assert_eq!("0.35".parse::<At>().expect("a share"), At::Share(0.35));
        assert_eq!("12.5,-3".parse::<At>().expect("a place"), At::Place([12.5, -3.0]));
        for wrong in ["1.5", "a", "1,b", "1,2,3", "nan", "inf,0"] {
            assert!(wrong.parse::<At>().is_err(), "{wrong}");
        }
    }
}
