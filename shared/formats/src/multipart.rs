//! Streams of images in parts (RFC 2046, `multipart/x-mixed-replace`), as sent by ffmpeg, `GStreamer` and network
//! cameras: a line `--boundary`, header lines with `Content-Length`, an empty line, the bytes of the image.
//!
//! The boundary is not compared: the length determines where the next part begins. The stated type is not used, because
//! ffmpeg states `image/jpeg` for all images; the format is detected from the first bytes of an image.

use std::io::{self, BufRead, Read};

/// Longest line of a header, bytes.
const MAX_LINE: u64 = 1024;
/// Lines of a header, and empty lines before a boundary.
const MAX_LINES: usize = 64;
/// Largest image, bytes: 100 million pixels of 16 bits.
const MAX_IMAGE_BYTES: u64 = 200_000_000;

/// Error of a stream that does not consist of images in parts. Parts are counted from 1.
#[derive(Debug, thiserror::Error)]
#[error("part {part}: {fault}")]
pub struct MultipartError {
    /// Number of the part.
    pub part: u64,
    /// Fault of the part.
    pub fault: MultipartFault,
}

/// Fault of a stream.
#[derive(Debug, thiserror::Error)]
pub enum MultipartFault {
    /// The operating system reported an error.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The part does not begin with a boundary.
    #[error("begins with {0:?}; expected a line --boundary, as of `ffmpeg -f mpjpeg` and multipartmux of GStreamer")]
    Boundary(String),
    /// The header is too long.
    #[error("the header has a line of more than {MAX_LINE} bytes or more than {MAX_LINES} lines")]
    Header,
    /// The header has no length, or an invalid one.
    #[error("Content-Length is {0:?}; expected 1 to {MAX_IMAGE_BYTES} bytes")]
    Length(String),
    /// The image has an unknown format.
    #[error("begins with the bytes {0:02x?}; expected an image in JPEG, PNG or PGM (P5)")]
    Format(Vec<u8>),
    /// The stream ends inside an image.
    #[error("the stream ends after {found} of {expected} bytes of the image")]
    Cut {
        /// Bytes of the image received.
        found: u64,
        /// Bytes of the image.
        expected: u64,
    },
}

/// Format of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
    /// Binary PGM.
    Pgm,
}

impl ImageFormat {
    /// The format, detected from the first bytes of a file.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let begins: [(&[u8], Self); 3] =
            [(b"\xff\xd8\xff", Self::Jpeg), (b"\x89PNG\r\n\x1a\n", Self::Png), (b"P5", Self::Pgm)];
        begins.into_iter().find(|(begin, _)| bytes.starts_with(begin)).map(|(_, format)| format)
    }

    /// Extension of file names.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Jpeg => "jpg",
            Self::Png => "png",
            Self::Pgm => "pgm",
        }
    }
}

/// Reads the images of a stream.
#[derive(Debug)]
pub struct MultipartReader<R> {
    stream: R,
    n_parts: u64,
}

impl<R: BufRead> MultipartReader<R> {
    /// A reader at the start of a stream.
    pub fn new(stream: R) -> Self {
        Self { stream, n_parts: 0 }
    }

    /// Waits for the header of the next image, and returns the length of the image in bytes; `None` at the end of the stream. Then
    /// [`MultipartReader::image`] must be called.
    pub fn next_header(&mut self) -> Result<Option<u64>, MultipartError> {
        self.n_parts += 1;
        self.header().map_err(|fault| self.error(fault))
    }

    /// Reads the image after its header, `n_bytes` long.
    pub fn image(&mut self, n_bytes: u64, image: &mut Vec<u8>) -> Result<ImageFormat, MultipartError> {
        image.clear();
        let read = self.stream.by_ref().take(n_bytes).read_to_end(image);
        let found = image.len() as u64;
        let fault = match read {
            Err(error) => MultipartFault::Io(error),
            Ok(_) if found < n_bytes => MultipartFault::Cut { found, expected: n_bytes },
            Ok(_) => match ImageFormat::from_bytes(image) {
                Some(format) => return Ok(format),
                None => MultipartFault::Format(image.iter().copied().take(8).collect()),
            },
        };
        Err(self.error(fault))
    }

    fn header(&mut self) -> Result<Option<u64>, MultipartFault> {
        let mut length = None;
        let mut has_boundary = false;
        let mut has_fields = false;
        for _ in 0..MAX_LINES {
            let Some(line) = self.line()? else {
                // ffmpeg ends the stream with the boundary of the next part.
                return if has_fields { Err(MultipartFault::Length("nothing".to_owned())) } else { Ok(None) };
            };
            if !has_boundary {
                if line.starts_with("--") {
                    has_boundary = true;
                } else if !line.is_empty() {
                    return Err(MultipartFault::Boundary(line));
                }
            } else if line.is_empty() {
                let found: String = length.unwrap_or_else(|| "nothing".to_owned());
                let n_bytes = found.parse().ok().filter(|n| (1..=MAX_IMAGE_BYTES).contains(n));
                return n_bytes.map(Some).ok_or(MultipartFault::Length(found));
            } else {
                has_fields = true;
                let value = line.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("Content-Length"));
                length = value.map(|(_, value)| value.trim().to_owned()).or(length);
            }
        }
        Err(MultipartFault::Header)
    }

    /// The next line without its end; `None` at the end of the stream.
    fn line(&mut self) -> Result<Option<String>, MultipartFault> {
        let mut line = Vec::new();
        let n = self.stream.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)?;
        if n as u64 == MAX_LINE && line.last() != Some(&b'\n') {
            return Err(MultipartFault::Header);
        }
        let is_end = n == 0;
        Ok((!is_end).then(|| String::from_utf8_lossy(line.trim_ascii_end()).into_owned()))
    }

    fn error(&self, fault: MultipartFault) -> MultipartError {
        MultipartError { part: self.n_parts, fault }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(stream: &[u8]) -> (Vec<(ImageFormat, Vec<u8>)>, Option<String>) {
        let mut reader = MultipartReader::new(stream);
        let mut images = Vec::new();
        let mut image = Vec::new();
        loop {
            match reader.next_header() {
                Ok(Some(n_bytes)) => match reader.image(n_bytes, &mut image) {
                    Ok(format) => images.push((format, image.clone())),
                    Err(error) => return (images, Some(error.to_string())),
                },
                Ok(None) => return (images, None),
                Err(error) => return (images, Some(error.to_string())),
            }
        }
    }

    /// Streams as written by ffmpeg 5.1 and `GStreamer` 1.22, with the end of RFC 2046, which has no header.
    const STREAM: &[u8] = b"--ffmpeg\r\nContent-type: image/jpeg\r\nContent-length: 5\r\n\r\n\xff\xd8\xff\r\n\r\n\
        --frame\r\nContent-Type: image/png\r\nContent-Length: 9\r\n\r\n\x89PNG\r\n\x1a\n7\
        --frame\nX-Timestamp: 7.5\nContent-Length: 11\n\nP5 1 1 255\n\n--frame--\r\n";

    #[test]
    fn images_of_ffmpeg_and_gstreamer_are_read() {
        let (images, error) = read(STREAM);
        let expected = [
            (ImageFormat::Jpeg, b"\xff\xd8\xff\r\n".to_vec()),
            (ImageFormat::Png, b"\x89PNG\r\n\x1a\n7".to_vec()),
            (ImageFormat::Pgm, b"P5 1 1 255\n".to_vec()),
        ];
        assert_eq!(images, expected);
        assert_eq!(error, None);
    }

    #[test]
    fn stream_that_is_cut_or_of_another_kind_is_refused_with_part_and_rule() {
        for (stream, rule) in [
            (&STREAM[..60], "part 1: the stream ends after 3 of 5 bytes of the image"),
            (b"\xff\xd8\xff\xe0 a bare image", "part 1: begins with"),
            (b"--a\r\n\r\n", "part 1: Content-Length is \"nothing\"; expected 1 to"),
            (b"--a\r\nContent-Length: -5\r\n\r\n", "part 1: Content-Length is \"-5\""),
            (b"--a\r\nContent-Length: 99999999999\r\n\r\n", "part 1: Content-Length is \"99999999999\""),
            (b"--a\r\nContent-Length: 4\r\n\r\nGIF8", "part 1: begins with the bytes [47, 49, 46, 38]; expected"),
        ] {
            let (images, error) = read(stream);
            assert!(images.is_empty() && error.as_ref().is_some_and(|text| text.starts_with(rule)), "{error:?}");
        }
        for endless in [[&b"--a\r\n"[..], &[b'x'; 5000]].concat(), b"\r\n".repeat(5000), b"--a\r\nX: 1\r\n".repeat(900)]
        {
            let (_, error) = read(&endless);
            assert!(error.as_ref().is_some_and(|text| text.contains("the header has a line")), "{error:?}");
        }
    }

    #[test]
    fn stream_that_is_cut_anywhere_gives_complete_images_only() {
        let (whole, _) = read(STREAM);
        for length in 0..STREAM.len() {
            let (images, _) = read(&STREAM[..length]);
            assert!(whole.starts_with(&images), "{length}");
        }
    }
}
