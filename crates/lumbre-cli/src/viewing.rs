//! `lumbre view`: the picture in the browser while it is rendered.

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use lumbre::image::ToneMap;
use lumbre::{CancelToken, ErrorKind, RenderOptions, SceneDesc, Stop};
use lumbre_viewer::{Built, Explain, Hidden, Moment, Options, Read, Source, SourceError, Viewer, export};

use crate::explain::program::Explainer;
use crate::failure::{Failure, print};
use crate::names::one_of;
use crate::output::is_standard_stream;
use crate::reading::ReadingArguments;
use crate::render::{exposure, noise};
use crate::shown::{PreparedScene, SceneRequest, shown};
use crate::signals::{Phase, Signals};
use crate::staging::{Backdrop, StagingArguments};
use crate::units;
use crate::view::ViewArguments;

/// Shows a scene in the browser, live.
///
/// Move the camera, inspect pixels, and see every edit of the file when it is saved.
#[derive(Args)]
#[command(after_help = "Examples:
  lumbre view scene.pbrt                        opens a page that shows the picture
  lumbre view chair.glb --size 1280x720
  lumbre view scene.pbrt --overlay evening.txt  with edits that the page has saved
  lumbre view scene.pbrt --export page          a page of the finished picture, in a folder
  lumbre view                                   an empty page, on which files and folders can be dropped
  lumbre view scene.pbrt --share=2              two more addresses, for browsers that may look and not edit

On another machine: with the same port at both ends, then open the address that is printed.
  ssh -L 8765:127.0.0.1:8765 HOST lumbre view --no-open --port 8765 scene.pbrt")]
pub(crate) struct Arguments {
    /// The scene: .pbrt, .gltf, .glb, .obj, .ply, .stl or .pov, also compressed with gzip. Several are put into the
    /// same world.
    #[arg(value_name = "SCENE")]
    scene: Vec<PathBuf>,
    /// The port. By default a free one.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = units::whole(0..=u16::MAX))]
    port: u16,
    /// The address to listen at. Any other address than 127.0.0.1 exposes the page, unencrypted, to the network: prefer
    /// an ssh tunnel.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    host: IpAddr,
    /// Another name under which browsers reach the page, such as localhost:9000 for a tunnel that begins at another
    /// port.
    #[arg(long, value_name = "NAME:PORT", value_parser = name_and_port)]
    allow_host: Vec<String>,
    /// Print N more addresses (1 without a number), each for one more browser, which shows what the first one does but
    /// cannot edit.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "1", require_equals = true,
          value_parser = units::whole(1_u8..=32))]
    share: Option<u8>,
    /// Only print the address.
    #[arg(long)]
    no_open: bool,
    /// Write a page of the finished picture into this folder instead, with its channels, pixel values and facts of the
    /// scene. The page opens from a file, and can be sent or put on a web server.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["port", "host", "allow_host", "no_open", "share"])]
    export: Option<PathBuf>,
    /// Samples per pixel. By default as many as the scene says, else 64; 16 for a model that is denoised.
    #[arg(long, value_name = "N", value_parser = units::whole(1..=u32::MAX))]
    spp: Option<u32>,
    /// Stop sampling a pixel when its noise is below this share of its luminance, such as 0.02, as render does. The
    /// page can change it.
    #[arg(long, value_name = "R", value_parser = noise)]
    noise: Option<f64>,
    /// With --noise: at least this many samples per pixel.
    #[arg(long, value_name = "N", requires = "noise", value_parser = units::whole(1..=u32::MAX))]
    min_spp: Option<u32>,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", value_parser = units::size)]
    size: Option<(u32, u32)>,
    /// A camera of the scene, by its name or its index from 0.
    #[arg(long, value_name = "NAME|INDEX", help_heading = "View")]
    camera: Option<String>,
    /// Exposure in stops. The page can change it.
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = exposure)]
    exposure: Option<f32>,
    /// Tone mapping. The page can change it.
    #[arg(long, value_name = "NAME", value_parser = one_of(&ToneMap::NAMES, ToneMap::from_name))]
    tonemap: Option<ToneMap>,
    #[command(flatten)]
    view: ViewArguments,
    #[command(flatten)]
    staging: StagingArguments,
    #[command(flatten)]
    reading: ReadingArguments,
}

/// The name and the port of a host, as browsers send them.
fn name_and_port(text: &str) -> Result<String, String> {
    let parts = text.rsplit_once(':').filter(|(name, port)| {
        let is_whole = !name.contains(':') || (name.starts_with('[') && name.ends_with(']'));
        !name.is_empty() && is_whole && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    parts.map(|_| text.to_owned()).ok_or_else(|| "expected NAME:PORT, such as localhost:9000".to_owned())
}

/// Runs the command.
pub(crate) fn run(arguments: Arguments) -> Result<(), Failure> {
    if arguments.staging.turntable().is_some() {
        let why = "--turntable makes many pictures (expected lumbre render)";
        return Err(Failure::Usage(why.to_owned()));
    }
    if arguments.host.is_unspecified() && arguments.allow_host.is_empty() {
        let why = "is not an address that a browser can open (expected one of this machine's, or --allow-host NAME:PORT too)";
        return Err(Failure::Usage(format!("--host {} {why}", arguments.host)));
    }
    // What is no scene is said here; what an edit mends is shown in the page.
    for path in arguments.scene.iter().filter(|path| !is_standard_stream(path)) {
        arguments.reading.check_file(path)?;
    }
    let cancel = CancelToken::new();
    let signals = Signals::listen(&cancel)?;
    if let Some(folder) = arguments.export.clone() {
        if arguments.scene.is_empty() {
            return Err(Failure::Usage("--export needs a scene".to_owned()));
        }
        signals.enter(Phase::Rendering);
        let files = Files::new(arguments);
        if folder.exists() && !folder.is_dir() {
            return Err(Failure::Usage(format!("{} is a file (expected a folder)", folder.display())));
        }
        export(&files, &folder, &cancel).map_err(Failure::from)?;
        say!("{}: open it in a browser", folder.join("index.html").display());
        return signals.received().map_or(Ok(()), |status| Err(Failure::Interrupted(status)));
    }
    let mut options = Options::default();
    options.address = (arguments.host, arguments.port).into();
    options.hosts.clone_from(&arguments.allow_host);
    options.session_file = session_file(arguments.port);
    options.watchers = arguments.share.map_or(0, usize::from);
    let opens = !arguments.no_open;
    let source = Arc::new(Files::new(arguments));
    let viewer = Viewer::new(source, &options).map_err(Failure::Io)?;
    if !options.address.ip().is_loopback() {
        say!(
            "warning: {} can be reached from other machines, and what is sent is not encrypted",
            viewer.address()
        );
    }
    let reached = |url: String| match options.hosts.first().filter(|_| options.address.ip().is_unspecified())
    {
        Some(name) => url.replacen(&viewer.address().to_string(), name, 1),
        None => url,
    };
    let url = reached(viewer.url());
    let watchers = viewer.watcher_urls().into_iter().map(reached);
    let lines: String = std::iter::once(url.clone()).chain(watchers).map(|url| url + "\n").collect();
    print(&lines)?;
    if options.watchers > 0 {
        say!("the first address is yours; each of the others is for one browser that only watches");
    }
    if opens && !open(&url) {
        say!("open this address in a browser; Ctrl-C ends the viewer");
    }
    let closer = viewer.closer();
    let stopped = cancel.clone();
    std::thread::spawn(move || {
        while !stopped.is_cancelled() {
            std::thread::sleep(Duration::from_millis(20));
        }
        closer.close();
    });
    signals.enter(Phase::Rendering);
    viewer.run().map_err(Failure::Io)?;
    match signals.received() {
        Some(status) => Err(Failure::Interrupted(status)),
        None => Ok(()),
    }
}

/// Where the session of a port that was asked for is kept until the user logs out; nowhere on systems without such a
/// folder.
fn session_file(port: u16) -> Option<PathBuf> {
    let folder = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty() && port != 0)?;
    let folder = Path::new(&folder);
    folder.is_dir().then(|| folder.join(format!("lumbre-view-{port}")))
}

/// Opens an address in the browser of who sits at this machine; whether there seems to be one.
fn open(url: &str) -> bool {
    let is_far = std::env::var_os("SSH_CONNECTION").is_some();
    let has_screen = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    let (program, first): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ if has_screen => ("xdg-open", &[]),
        _ => return false,
    };
    if is_far {
        return false;
    }
    let mut command = Command::new(program);
    command.args(first).arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().is_ok()
}

impl From<Failure> for SourceError {
    fn from(failure: Failure) -> Self {
        let kind = match failure {
            Failure::Io(_) => ErrorKind::Io,
            Failure::Limit(_) => ErrorKind::Limit,
            Failure::Usage(_) => ErrorKind::Options,
            Failure::Input(_) | Failure::Different | Failure::Interrupted(_) => ErrorKind::Input,
        };
        Self { kind, message: failure.to_string() }
    }
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        Self::of_kind(error.kind, error.message)
    }
}

/// The files of the command line, or those that came later.
struct Files {
    arguments: Arc<Arguments>,
    dropped: Option<Dropped>,
    /// A picture of light from all around that came later.
    environment: Option<PathBuf>,
}

/// What came through the page.
#[derive(Clone)]
struct Dropped {
    folder: PathBuf,
    scene: PathBuf,
}

impl Files {
    fn new(arguments: Arguments) -> Self {
        Self { arguments: Arc::new(arguments), dropped: None, environment: None }
    }

    fn paths(&self) -> Vec<PathBuf> {
        self.dropped
            .as_ref()
            .map_or_else(|| self.arguments.scene.clone(), |dropped| vec![dropped.scene.clone()])
    }
}

impl Source for Files {
    fn name(&self) -> String {
        let path = self.paths().into_iter().next().unwrap_or_default();
        path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    }

    fn files(&self) -> Vec<PathBuf> {
        let overlays = self.arguments.reading.overlays().map(Path::to_owned);
        self.paths().into_iter().chain(overlays).collect()
    }

    fn read(&self, moment: &Moment) -> Result<Read, SourceError> {
        // What came through the page may be a stranger's, and has no files beside it.
        let folder = self.dropped.as_ref().map(|dropped| &*dropped.folder);
        let (desc, diagnostics) = self.arguments.reading.describe_moment(
            &self.paths(),
            moment.time,
            moment.variant.as_deref(),
            folder,
        )?;
        let files = diagnostics.files_read().to_vec();
        let warnings = diagnostics.lines();
        Ok(Read { desc, files, warnings })
    }

    fn build(&self, desc: SceneDesc, hidden: &Hidden) -> Result<Built, SourceError> {
        Ok(self.built(desc, hidden)?)
    }

    fn check(&self, options: &RenderOptions) -> Result<(), SourceError> {
        Ok(self.arguments.reading.memory().check_picture(options, 0)?)
    }

    fn of_folder(&self, folder: &Path, scene: &Path) -> Arc<dyn Source> {
        let dropped = Some(Dropped { folder: folder.to_owned(), scene: scene.to_owned() });
        Arc::new(Self { arguments: self.arguments.clone(), dropped, environment: self.environment.clone() })
    }

    fn in_light_of(&self, picture: &Path) -> Arc<dyn Source> {
        let (arguments, dropped) = (self.arguments.clone(), self.dropped.clone());
        Arc::new(Self { arguments, dropped, environment: Some(picture.to_owned()) })
    }

    fn is_empty(&self) -> bool {
        self.paths().is_empty()
    }
}

impl Files {
    /// As `lumbre render` would make its picture.
    fn built(&self, desc: SceneDesc, hidden: &Hidden) -> Result<Built, Failure> {
        let Arguments { view, staging, reading, size, .. } = &*self.arguments;
        let other_light = self.environment.as_deref().map(|picture| staging.in_light_of(picture));
        let staging = other_light.as_ref().unwrap_or(staging);
        let name = self.paths().into_iter().next().unwrap_or_default();
        // The camera that was asked for is of the command line's file.
        let camera = self.arguments.camera.as_deref().filter(|_| self.dropped.is_none());
        let hidden = Some(hidden);
        let wish = SceneRequest {
            name: &name,
            size: *size,
            camera,
            integrator: None,
            view,
            staging,
            reading,
            hidden,
        };
        let explain = Some(Box::new(Explainer::new(&desc, self.name())) as Box<dyn Explain>);
        let PreparedScene { scene, prepared, behind, mut options, diagnostics } = shown(desc, &wish)?;
        let mut warnings = diagnostics.lines();
        options.threads = rayon::current_num_threads();
        let Arguments { spp, noise, min_spp, .. } = &*self.arguments;
        (options.stop.noise, options.stop.min_spp) = (*noise, *min_spp);
        options.stop.spp =
            spp.unwrap_or(if noise.is_some() { Stop::MAX_FOR_NOISE } else { options.stop.spp });
        let held = diagnostics.memory_held().saturating_add(scene.resolved().accel().memory_bytes() as u64);
        reading.memory().check_picture(&options, held)?;
        if scene.is_dark_by(options.integrator.kind) {
            warnings
                .push(format!("warning: {}: the scene has no light: its picture is black", name.display()));
        }
        let mut save = prepared.save_options(&scene);
        save.exposure = match self.arguments.exposure {
            Some(exposure) => exposure,
            None => prepared.exposure(&scene, &options)?,
        };
        save.tone_map = self.arguments.tonemap.unwrap_or(save.tone_map);
        let background = match behind {
            Backdrop::Background(background) => Some(background),
            Backdrop::Lights | Backdrop::Nothing => None,
        };
        Ok(Built { scene, options, save, background, denoise: prepared.denoises(), warnings, explain })
    }
}

#[cfg(test)]
mod tests {
    use super::name_and_port;

    #[test]
    fn other_hosts_have_a_name_and_a_port() {
        for text in ["localhost:9000", "[::1]:80", "far.example.org:65535"] {
            assert_eq!(name_and_port(text), Ok(text.to_owned()));
        }
        for text in ["", "far", "far:", "far:0", ":80", "far:65536", "far:x", "a:b:80"] {
            assert!(name_and_port(text).is_err(), "{text}");
        }
    }
}
