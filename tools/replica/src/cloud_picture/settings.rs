//! What a picture shows, and how.

use clap::ValueEnum;
use std::str::FromStr;

/// The attribute that a point's color shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ColorBy {
    /// Color from the cameras.
    Color,
    /// Class, in CARLA's colors.
    Class,
    /// Intensity of the return.
    Intensity,
    /// Height.
    Height,
    /// Instance; points without one are gray.
    Instance,
}

/// The position of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Viewpoint {
    /// Orthographic from above; north is up.
    Top,
    /// Perspective from behind and above the vehicle.
    Street,
}

/// What is behind the points.
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
    pub width: usize,
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
#[derive(Clone, Copy, Debug)]
pub struct PictureSettings {
    /// `None`: color if there is any, else class, else height.
    pub color_by: Option<ColorBy>,
    pub size: PictureSize,
    pub viewpoint: Viewpoint,
    /// Street view: position along the path, 0 to 1.
    pub at: f64,
    pub background: Background,
}
