//! `replica grab`: writes the images of a stream as files that are named by their stamps.

use crate::terminal::StopFlag;
use anyhow::Context;
use formats::atomic_file::AtomicFile;
use formats::multipart::MultipartReader;
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
#[command(after_help = "Exit codes: 0 the stream ended or Ctrl-C, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Folder of the camera, below acquire.cameras; created if absent
    folder: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let stop = StopFlag::register(exit::DONE)?;
    fs::create_dir_all(&args.folder).with_context(|| args.folder.display().to_string())?;
    let mut n_images = 0;
    // The grabber ends by the same Ctrl-C, and so does the stream.
    let grabbed = grab(BufReader::new(io::stdin().lock()), &args.folder, nanos_now, |_| {
        n_images += 1;
        !stop.is_set()
    });
    eprintln!("{n_images} images in {}", args.folder.display());
    grabbed.map(|()| ExitCode::SUCCESS)
}

/// Writes each image, named by `nanos` when its header has arrived, until the stream ends or `goes_on` returns `false` for the file.
fn grab(
    stream: impl BufRead,
    folder: &Path,
    mut nanos: impl FnMut() -> i64,
    mut goes_on: impl FnMut(&Path) -> bool,
) -> anyhow::Result<()> {
    let mut reader = MultipartReader::new(stream);
    let mut image = Vec::new();
    while let Some(n_bytes) = reader.next_header()? {
        // The grabber sends an image at once; a large one then takes some ms.
        let stamp = nanos();
        let format = reader.image(n_bytes, &mut image)?;
        let path = folder.join(format!("{stamp}.{}", format.extension()));
        // Recorded only when it is complete.
        let file = AtomicFile::create(&path).with_context(|| path.display().to_string())?;
        file.file().write_all(&image).with_context(|| path.display().to_string())?;
        file.commit_unsynced().with_context(|| path.display().to_string())?;
        if !goes_on(&path) {
            break;
        }
    }
    Ok(())
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
        grab(&stream(&images)[..], folder.path(), clock, Path::is_file).expect("reads");
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
        let error = grab(&whole[..whole.len() - 5], folder.path(), &mut next, |_| true).expect_err("is cut");
        assert_eq!(error.to_string(), "part 2: the stream ends after 8 of 11 bytes of the image");
        assert_eq!(written(folder.path()), [("7.jpg".to_owned(), b"\xff\xd8\xff\xe0 first".to_vec())]);
        grab(&whole[..], folder.path(), &mut next, |_| false).expect("stops");
        assert_eq!(written(folder.path()).len(), 2);
    }
}
