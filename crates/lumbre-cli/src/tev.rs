//! `--tev`: the picture in a tev that is open, as it is rendered: <https://github.com/Tom94/tev>.

use std::io::Write;
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use lumbre::image::Image;

use crate::failure::Failure;
use crate::progress::PictureViewer;

/// Kinds of packets.
const UPDATE: u8 = 3;
const CREATE: u8 = 4;
/// The channels of a picture.
const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// Rows of a tile.
const ROWS: u32 = 64;
/// Between two pictures.
const EVERY: Duration = Duration::from_millis(250);
/// How long it may take to reach it, and to hand it a packet.
const PATIENCE: Duration = Duration::from_secs(3);

/// A connection to tev, and its messages.
pub(crate) struct Tev {
    name: String,
    state: Mutex<State>,
}

struct State {
    /// `None` since it went away.
    stream: Option<TcpStream>,
    size: Option<(u32, u32)>,
    last: Option<Instant>,
}

impl Tev {
    /// Reaches a tev at `HOST:PORT`, or at a host with the port that it has by default.
    ///
    /// # Errors
    /// [`Failure::Io`] where there is none.
    pub(crate) fn connect(address: &str, name: &str) -> Result<Self, Failure> {
        const PORT: u16 = 14158;
        let with_port = if address.contains(':') { address.to_owned() } else { format!("{address}:{PORT}") };
        let wrong = |why: String| {
            Failure::Io(format!("--tev: {with_port}: {why} (expected the HOST:PORT of a running tev)"))
        };
        let found = with_port.to_socket_addrs().map_err(|e| wrong(e.to_string()))?.next();
        let found = found.ok_or_else(|| wrong("there is no such host".to_owned()))?;
        let stream = TcpStream::connect_timeout(&found, PATIENCE).map_err(|e| wrong(e.to_string()))?;
        stream.set_write_timeout(Some(PATIENCE)).map_err(|e| wrong(e.to_string()))?;
        let state = State { stream: Some(stream), size: None, last: None };
        Ok(Self { name: name.to_owned(), state: Mutex::new(state) })
    }
}

impl PictureViewer for Tev {
    fn show(&self, picture: &dyn Fn() -> Image, is_last: bool) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let is_soon = !is_last && state.last.is_some_and(|last| last.elapsed() < EVERY);
        if state.stream.is_none() || is_soon {
            return;
        }
        let image = picture();
        let size = (image.width(), image.height());
        let mut packets = Vec::new();
        if state.size != Some(size) {
            packets.push(create(&self.name, size));
            state.size = Some(size);
        }
        packets.extend(updates(&self.name, &image));
        if let Some(stream) = &mut state.stream
            && let Err(error) = packets.iter().try_for_each(|packet| stream.write_all(packet))
        {
            say!("warning: tev no longer accepts the picture: {error}");
            state.stream = None;
        }
        state.last = Some(Instant::now());
    }
}

/// A packet: its length with these four bytes, its kind, and the rest.
fn packet(kind: u8, write: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = vec![0, 0, 0, 0, kind];
    write(&mut bytes);
    let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    bytes[..4].copy_from_slice(&length.to_le_bytes());
    bytes
}

fn put_text(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend(text.bytes().filter(|byte| *byte != 0));
    bytes.push(0);
}

fn put_numbers<const N: usize>(bytes: &mut Vec<u8>, numbers: [u32; N]) {
    bytes.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
}

fn create(name: &str, (width, height): (u32, u32)) -> Vec<u8> {
    packet(CREATE, |bytes| {
        // It comes to the front.
        bytes.push(1);
        put_text(bytes, name);
        put_numbers(bytes, [width, height, CHANNELS.len() as u32]);
        CHANNELS.iter().for_each(|channel| put_text(bytes, channel));
    })
}

/// Tiles of all channels.
fn updates(name: &str, image: &Image) -> Vec<Vec<u8>> {
    let (width, height) = (image.width(), image.height());
    let mut packets = Vec::new();
    for top in (0..height).step_by(ROWS as usize) {
        let rows = ROWS.min(height - top);
        for (c, channel) in CHANNELS.iter().enumerate() {
            packets.push(packet(UPDATE, |bytes| {
                bytes.push(0);
                put_text(bytes, name);
                put_text(bytes, channel);
                put_numbers(bytes, [0, top, width, rows]);
                let from = (top * width) as usize;
                let pixels = &image.pixels()[from..from + (rows * width) as usize];
                bytes.extend(pixels.iter().flat_map(|pixel| pixel.to_array()[c].to_le_bytes()));
            }));
        }
    }
    packets
}

#[cfg(test)]
mod tests {
    use lumbre::image::Rgb;

    use super::*;

    fn number(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    #[test]
    fn packets_cover_the_picture_once_per_channel() {
        let made = create("fox", (5, 70));
        assert_eq!(
            (number(&made, 0) as usize, made[4], made[5], &made[6..10]),
            (made.len(), CREATE, 1, &b"fox\0"[..])
        );
        assert_eq!((number(&made, 10), number(&made, 14), number(&made, 18)), (5, 70, 3));
        assert_eq!(&made[22..], b"R\0G\0B\0");
        let pixels = (0..350).map(|i| Rgb::new(i as f32, 2.0, 3.0)).collect();
        let told = updates("fox", &Image::from_pixels(5, 70, pixels).unwrap());
        assert_eq!(told.len(), 6);
        let last_red = &told[3];
        assert_eq!(number(last_red, 0) as usize, last_red.len());
        assert_eq!(&last_red[4..12], b"\x03\0fox\0R\0");
        let place: Vec<u32> = (0..4).map(|i| number(last_red, 12 + 4 * i)).collect();
        assert_eq!(place, [0, 64, 5, 6]);
        assert_eq!(f32::from_bits(number(last_red, 28)), 320.0);
        assert_eq!(last_red.len(), 28 + 4 * 5 * 6);
    }
}
