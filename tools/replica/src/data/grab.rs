//! `replica grab`: writes the images of a stream as files named by their stamps.

use anyhow::Context;
use command_line::exit_code;
use command_line::say_error;
use command_line::terminal::StopFlag;
use files::atomic_file::AtomicFile;
use formats::multipart::MultipartReader;
use formats::pgm::{Pgm, pgm_from_samples};
use run::exit;
use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::SystemTime;

/// Write images from stdin into the folder of a live camera.
///
/// Reads images in parts, as `ffmpeg -f mpjpeg`, multipartmux of `GStreamer` and network cameras send them: JPEG, PNG, or PGM of a mosaic
/// camera. A file is named by the time at which its image arrived, in ns since the Unix epoch, by the clock of this computer. That is
/// later than the exposure: set `delay_nanos` of the camera in drive.toml.
#[derive(clap::Args, Debug)]
#[command(
    after_help = "Exit codes: 0 the stream ended or Ctrl-C, 1 failed, 2 wrong usage, 3 images were left out because of --bit-depth\n\n\
                  Example: curl -sN http://192.168.1.90/video.mjpg | replica grab grabber/camera/0"
)]
pub struct Args {
    /// Folder of the camera, below acquire.cameras; created if absent
    folder: PathBuf,
    /// Bits of a sample of PGM images (1 to 16), as in drive.toml
    ///
    /// Grabbers declare 16 bits whatever the sensor has. The files then have the largest value of these bits as maximum. Images with
    /// larger samples are left out and counted.
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u16).range(1..=16))]
    bit_depth: Option<u16>,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let stop = StopFlag::register(exit::DONE)?;
    fs::create_dir_all(&args.folder).with_context(|| args.folder.display().to_string())?;
    let mut n_images = 0;
    let mut n_left_out = 0;
    let max = args.bit_depth.map(|bits| ((1_u32 << bits) - 1) as u16);
    // The same Ctrl-C ends the grabber and thus the stream.
    let grabbed = grab(BufReader::new(io::stdin().lock()), &args.folder, max, nanos_now, |written| {
        match written {
            Ok(_) => n_images += 1,
            Err(error) => {
                if n_left_out == 0 {
                    say_error!("image left out: {error}");
                }
                n_left_out += 1;
            }
        }
        !stop.is_set()
    });
    say_error!("{n_images} images in {}, {n_left_out} left out", args.folder.display());
    grabbed.map(|()| if n_left_out == 0 { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}

/// Writes each image, named by `nanos` when its header has arrived, until the stream ends or `goes_on` returns `false` for the file, or
/// for the reason why an image is left out. `max`: largest value of the samples of PGM images.
fn grab(
    stream: impl BufRead,
    folder: &Path,
    max: Option<u16>,
    mut nanos: impl FnMut() -> i64,
    mut goes_on: impl FnMut(Result<&Path, String>) -> bool,
) -> anyhow::Result<()> {
    let mut reader = MultipartReader::new(stream);
    let mut image = Vec::new();
    while let Some(n_bytes) = reader.next_header()? {
        // The grabber sends an image at once; a large one then takes some ms.
        let stamp = nanos();
        let format = reader.image(n_bytes, &mut image)?;
        if let Some(max) = max.filter(|_| format.extension() == "pgm") {
            match with_max(&image, max) {
                Ok(bytes) => image = bytes,
                Err(error) if goes_on(Err(error.clone())) => continue,
                Err(_) => break,
            }
        }
        let path = folder.join(format!("{stamp}.{}", format.extension()));
        // Recorded only when it is complete.
        let file = AtomicFile::create(&path).with_context(|| path.display().to_string())?;
        file.file().write_all(&image).with_context(|| path.display().to_string())?;
        file.commit_unsynced().with_context(|| path.display().to_string())?;
        if !goes_on(Ok(&path)) {
            break;
        }
    }
    Ok(())
}

/// The image with the same samples and `max` as the largest possible value.
fn with_max(bytes: &[u8], max: u16) -> Result<Vec<u8>, String> {
    let image = Pgm::parse(bytes).map_err(|error| error.to_string())?;
    let samples = image.samples();
    if let Some(at) = samples.iter().position(|sample| *sample > max) {
        let row = at / image.width as usize;
        let column = at % image.width as usize;
        let sample = samples[at];
        return Err(format!("sample {sample} at row {row}, column {column}; at most {max} with this --bit-depth"));
    }
    Ok(pgm_from_samples(image.width, image.height, max, &samples))
}

fn nanos_now() -> i64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(images: &[&[u8]]) -> Vec<u8> {
        let part = |image: &&[u8]| {
            let header = format!("--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", image.len());
            [header.as_bytes(), image, b"\r\n"].concat()
        };
        images.iter().flat_map(part).collect()
    }

    fn written(folder: &Path) -> Vec<(String, Vec<u8>)> {
        let entries = fs::read_dir(folder).expect("lists").map(|entry| entry.expect("lists"));
        let mut files: Vec<_> = entries
            .map(|entry| (entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path()).expect("reads")))
            .collect();
        files.sort();
        files
    }

    #[test]
    fn each_image_is_a_file_named_by_the_time_of_its_arrival() {
        let folder = tempfile::tempdir().expect("a folder");
        let images: [&[u8]; 3] = [b"\xff\xd8\xff\xe0 first", b"P5 1 1 255\n7", b"\xff\xd8\xff\xe0 third"];
        let mut now = 1_700_000_000_000_000_000;
        let clock = || {
            now += 100_000_000;
            now
        };
        grab(&stream(&images)[..], folder.path(), None, clock, |file| file.is_ok_and(Path::is_file)).expect("reads");
        let expected = ["1700000000100000000.jpg", "1700000000200000000.pgm", "1700000000300000000.jpg"];
        let expected: Vec<_> =
            expected.iter().zip(images).map(|(name, image)| ((*name).to_owned(), image.to_vec())).collect();
        assert_eq!(written(folder.path()), expected);
    }

    #[test]
    fn stream_that_is_cut_keeps_complete_images_only_and_a_stop_ends_after_an_image() {
        let folder = tempfile::tempdir().expect("a folder");
        let whole = stream(&[b"\xff\xd8\xff\xe0 first", b"\xff\xd8\xff\xe0 second"]);
        let mut clock = [7, 8, 9].into_iter();
        let mut next = || clock.next().expect("has more");
        let error = grab(&whole[..whole.len() - 5], folder.path(), None, &mut next, |_| true).expect_err("is cut");
        assert_eq!(error.to_string(), "part 2: the stream ends after 8 of 11 bytes of the image");
        assert_eq!(written(folder.path()), [("7.jpg".to_owned(), b"\xff\xd8\xff\xe0 first".to_vec())]);
        grab(&whole[..], folder.path(), None, &mut next, |_| false).expect("stops");
        assert_eq!(written(folder.path()).len(), 2);
    }

    #[test]
    fn samples_keep_their_values_and_get_the_maximum_of_their_bits() {
        let folder = tempfile::tempdir().expect("a folder");
        let images = [[1, 1023], [4, 1024]].map(|samples| pgm_from_samples(2, 1, 65_535, &samples));
        let mut left_out = Vec::new();
        let stream = stream(&[&images[0], &images[1], b"\xff\xd8\xff\xe0 no PGM"]);
        let mut clock = 1..;
        let next = || clock.next().expect("has more");
        grab(&stream[..], folder.path(), Some(1023), next, |file| {
            left_out.extend(file.err());
            true
        })
        .expect("reads");
        let files = written(folder.path());
        assert_eq!(files[0], ("1.pgm".to_owned(), pgm_from_samples(2, 1, 1023, &[1, 1023])));
        assert_eq!((files.len(), files[1].0.as_str()), (2, "3.jpg"));
        assert_eq!(left_out, ["sample 1024 at row 0, column 1; at most 1023 with this --bit-depth"]);
    }
}
