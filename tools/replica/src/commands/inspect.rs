//! `replica inspect`: what is in a cloud, as a table and as a picture.

mod camera;
mod canvas;
mod cloud;
mod palette;
mod survey;

use anyhow::{Context, ensure};
use camera::Camera;
use canvas::Canvas;
use clap::ValueEnum;
use cloud::Cloud;
use palette::Painter;
use std::io::Write;
use std::path::PathBuf;
use std::str::FromStr;
use survey::Survey;

/// Shows points, bounds, classes and instances of clouds, and renders a picture.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// A PLY file, or the output folder of a run.
    path: PathBuf,
    /// Renders a picture into this PNG.
    #[arg(long, value_name = "PNG")]
    picture: Option<PathBuf>,
    /// What the picture's colors say [default: color if there is any, else class, else height].
    #[arg(long)]
    by: Option<By>,
    /// Size of the picture, px.
    #[arg(long, default_value = "1600x900")]
    size: Size,
    /// From where the picture is taken.
    #[arg(long, default_value = "street")]
    view: View,
    /// Street view: where along the path the picture is taken, 0 to 1.
    #[arg(long, default_value_t = 0.35)]
    at: f64,
    /// What is behind the points.
    #[arg(long, default_value = "dark")]
    background: Background,
}

/// What a point's color stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum By {
    /// As the cameras saw it.
    Color,
    /// Its class, in CARLA's colors.
    Class,
    /// Strength of the return.
    Intensity,
    /// Height.
    Height,
    /// Its instance; the rest is gray.
    Instance,
}

/// Where the eye is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum View {
    /// From straight above, without perspective; north is up.
    Top,
    /// From behind and above the vehicle.
    Street,
}

/// What is behind the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Background {
    /// Night blue.
    Dark,
    /// Paper.
    White,
}

/// Columns and rows, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size {
    width: usize,
    height: usize,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // 8192 x 8192 takes 2 GB while it is rendered.
        let side = |text: &str| text.parse().ok().filter(|side| (16..=8192).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| "must be WIDTHxHEIGHT, each 16 to 8192".to_owned())
    }
}

/// Prints the table and renders the picture, if one is asked for.
pub fn run(args: &Args) -> anyhow::Result<()> {
    ensure!((0.0..=1.0).contains(&args.at), "--at is {}, must be between 0 and 1", args.at);
    let files = cloud::files(&args.path)?;
    let mut survey = Survey::default();
    for file in &files {
        survey.add(file, &Cloud::load(file)?);
    }
    // A reader that closes the pipe early has seen what it wanted.
    let _ = std::io::stdout().write_all(survey.table(&args.path).as_bytes());
    let Some(picture) = &args.picture else { return Ok(()) };
    let bounds = survey.bounds().with_context(|| format!("{}: no points to render", args.path.display()))?;
    let camera = match args.view {
        View::Top => Camera::above(bounds, survey.path(), args.size),
        View::Street => Camera::behind(bounds, survey.path(), args.at, args.size),
    };
    let painter = Painter::new(args.by.unwrap_or_else(|| survey.best_color()), &survey);
    let mut canvas = Canvas::new(args.size);
    for file in &files {
        let cloud = Cloud::load(file)?;
        for point_idx in 0..cloud.len() {
            canvas.splat(&camera, cloud.position(point_idx), painter.color(&cloud, point_idx));
        }
    }
    let pixels = canvas.develop(args.background);
    let (width, height) = (args.size.width as u32, args.size.height as u32);
    image::save_buffer_with_format(picture, &pixels, width, height, image::ColorType::Rgb8, image::ImageFormat::Png)
        .with_context(|| format!("{}: cannot write the picture", picture.display()))?;
    eprintln!("wrote {}", picture.display());
    Ok(())
}
