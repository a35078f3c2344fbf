//! Open Image Denoise 2, loaded at run time where it is installed: the only module of the program with `unsafe`.
//!
//! The declarations follow its documentation (Open Image Denoise 2 API reference, "C99 API", "Filters", "RT").

#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::ptr;

use libloading::Library;
use lumbre::image::{Image, Rgb};
use lumbre::{Denoised, Feature, Picture};

/// The variable that names the folder of the library.
const FOLDER: &str = "OIDN_DIR";

const LIBRARIES: &[&str] = if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// A device or a filter of the library.
type Handle = *mut c_void;

const DEVICE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;

/// Declares the functions of the library and how they are found in it.
macro_rules! functions {
    ($($name:ident = $symbol:literal : fn($($argument:ty),*) $(-> $answer:ty)?;)+) => {
        struct Api {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $answer)?,)+
            // Never let go of: threads that it started may still run when the program ends.
            _library: ManuallyDrop<Library>,
        }

        impl Api {
            fn load(path: &Path) -> Result<Self, libloading::Error> {
                // SAFETY: a file of this name is Open Image Denoise, in a place where the user or the system keeps
                // libraries; its initialisers are those of an ordinary library. The symbols have the types that version
                // 2 documents: the name of `oidnSetFilterBool` is of that version, so that another one is not taken for
                // it.
                unsafe {
                    let library = Library::new(path)?;
                    Ok(Self {
                        $($name: *library.get($symbol)?,)+
                        _library: ManuallyDrop::new(library),
                    })
                }
            }
        }
    };
}

functions! {
    new_device = b"oidnNewDevice\0": fn(c_int) -> Handle;
    set_device_int = b"oidnSetDeviceInt\0": fn(Handle, *const c_char, c_int);
    commit_device = b"oidnCommitDevice\0": fn(Handle);
    device_error = b"oidnGetDeviceError\0": fn(Handle, *mut *const c_char) -> c_int;
    release_device = b"oidnReleaseDevice\0": fn(Handle);
    new_filter = b"oidnNewFilter\0": fn(Handle, *const c_char) -> Handle;
    set_image = b"oidnSetSharedFilterImage\0":
        fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_bool = b"oidnSetFilterBool\0": fn(Handle, *const c_char, bool);
    commit_filter = b"oidnCommitFilter\0": fn(Handle);
    execute_filter = b"oidnExecuteFilter\0": fn(Handle);
    release_filter = b"oidnReleaseFilter\0": fn(Handle);
}

/// The library.
pub(crate) struct Oidn {
    api: Api,
}

impl Oidn {
    /// Loads it from where it is found first: the folder `OIDN_DIR`, the system's libraries, the Python package pyoidn.
    ///
    /// # Errors
    /// Where it was looked for in vain, and how to get it.
    pub(crate) fn load() -> Result<Self, String> {
        let mut broken = None;
        for path in candidates() {
            match Api::load(&path) {
                Ok(api) => return Ok(Self { api }),
                // What is there and does not load is worth a word.
                Err(e) if path.is_file() => broken = broken.or(Some(format!("{}: {e}", path.display()))),
                Err(_) => {}
            }
        }
        let found = broken.unwrap_or_else(|| "Open Image Denoise 2 is not installed".to_owned());
        Err(format!(
            "{found} (looked in {FOLDER}, the system's libraries, and pyoidn of python3; get it by \"pip install pyoidn\" or from \
             openimagedenoise.org, and set {FOLDER} to its folder; --denoise own needs nothing)"
        ))
    }

    /// The picture without noise, by its colours, albedo and normals; its coverage likewise.
    pub(crate) fn denoise(&self, picture: &Picture, threads: usize) -> Result<Denoised, String> {
        let guide = |feature| picture.feature(feature).map(floats).ok_or("there are no albedo and normals");
        let mut guides = [guide(Feature::Albedo)?, guide(Feature::Normal)?];
        let image = picture.image();
        let device = Device::new(&self.api, threads)?;
        let mut run = |colours: &Image, is_hdr| device.run(floats(colours), &mut guides, colours, is_hdr);
        let light = run(image, true)?;
        let Some(alpha) = image.alpha() else {
            return Ok(Denoised { image: light, coverage: None });
        };
        let grey =
            Image::from_pixels(image.width(), image.height(), alpha.iter().map(|&a| Rgb::splat(a)).collect());
        let covered = match picture.coverage() {
            Some(coverage) => run(coverage, false)?,
            None => run(&grey.ok_or("the picture has no size")?, false)?,
        };
        let alpha = covered.pixels().iter().map(|c| c.average().clamp(0.0, 1.0)).collect();
        let image = light.with_alpha(alpha).ok_or("the picture has no size")?;
        Ok(Denoised { image, coverage: picture.coverage().map(|_| covered) })
    }
}

/// Where the library may be, in the order in which it is looked for.
fn candidates() -> Vec<PathBuf> {
    let named = |folder: PathBuf| LIBRARIES.iter().map(move |name| folder.join(name));
    let mut all = Vec::new();
    if let Some(folder) = std::env::var_os(FOLDER).filter(|folder| !folder.is_empty()).map(PathBuf::from) {
        for place in ["", "lib", "lib64", "bin"] {
            all.extend(named(folder.join(place)));
        }
    }
    // Without a folder the system's loader looks for it.
    all.extend(LIBRARIES.iter().map(PathBuf::from));
    for packages in python_packages() {
        all.extend(named(packages.join("pyoidn").join("oidn").join("lib")));
    }
    all
}

/// The folders of packages of the `python3` that is first on the PATH, without running it.
fn python_packages() -> Vec<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let name = if cfg!(windows) { "python.exe" } else { "python3" };
    let Some(bin) = std::env::split_paths(&path).find(|folder| folder.join(name).is_file()) else {
        return Vec::new();
    };
    let Some(prefix) = bin.parent() else { return Vec::new() };
    let mut found = Vec::new();
    // As lib/python3.12/site-packages, and dist-packages for what Debian installs.
    for lib in ["lib", "local/lib"] {
        let Ok(folders) = std::fs::read_dir(prefix.join(lib)) else { continue };
        for folder in
            folders.flatten().filter(|folder| folder.file_name().to_string_lossy().starts_with("python3"))
        {
            found.extend(["site-packages", "dist-packages"].map(|packages| folder.path().join(packages)));
        }
    }
    found.push(prefix.join("Lib").join("site-packages"));
    found.sort_unstable();
    found
}

/// Three numbers a pixel.
fn floats(image: &Image) -> Vec<f32> {
    image.pixels().iter().flat_map(|pixel| pixel.to_array()).collect()
}

struct Device<'a> {
    api: &'a Api,
    handle: Handle,
}

impl<'a> Device<'a> {
    fn new(api: &'a Api, threads: usize) -> Result<Self, String> {
        // SAFETY: the function takes any kind of device, and answers with null where it has none.
        let handle = unsafe { (api.new_device)(DEVICE_CPU) };
        if handle.is_null() {
            return Err("there is no device for this processor".to_owned());
        }
        let device = Self { api, handle };
        let threads = c_int::try_from(threads).unwrap_or(0);
        // SAFETY: the device is live, and the name ends with a zero.
        unsafe {
            (api.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (api.commit_device)(handle);
        }
        device.check()?;
        Ok(device)
    }

    /// What went wrong, if anything did.
    fn check(&self) -> Result<(), String> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: the device is live; the message, if there is one, ends with a zero and lasts until the next call.
        unsafe {
            match (self.api.device_error)(self.handle, &mut message) {
                0 => Ok(()),
                code if message.is_null() => Err(format!("error {code}")),
                _ => Err(CStr::from_ptr(message).to_string_lossy().into_owned()),
            }
        }
    }

    /// Filters colours by albedo and normals, all of the size of `like`.
    fn run(
        &self,
        mut colours: Vec<f32>,
        guides: &mut [Vec<f32>; 2],
        like: &Image,
        is_hdr: bool,
    ) -> Result<Image, String> {
        let (width, height) = (like.width() as usize, like.height() as usize);
        let mut output = vec![0.0_f32; 3 * width * height];
        let [albedo, normal] = guides;
        let images =
            [(c"color", &mut colours), (c"albedo", albedo), (c"normal", normal), (c"output", &mut output)];
        if images.iter().any(|(_, numbers)| numbers.len() != 3 * width * height) {
            return Err("the pictures are of different sizes".to_owned());
        }
        // SAFETY: the device is live; names end with a zero; each image has three numbers for each of `width * height`
        // pixels, packed row by row, which the strides of 0 mean, and lives until the filter is released.
        unsafe {
            let filter = (self.api.new_filter)(self.handle, c"RT".as_ptr());
            if filter.is_null() {
                self.check()?;
                return Err("there is no filter RT".to_owned());
            }
            for (name, numbers) in images {
                let data = numbers.as_mut_ptr().cast();
                (self.api.set_image)(filter, name.as_ptr(), data, FORMAT_FLOAT3, width, height, 0, 0, 0);
            }
            (self.api.set_bool)(filter, c"hdr".as_ptr(), is_hdr);
            (self.api.commit_filter)(filter);
            (self.api.execute_filter)(filter);
            (self.api.release_filter)(filter);
        }
        self.check()?;
        let pixels = output.chunks_exact(3).map(|c| Rgb::new(c[0], c[1], c[2])).collect();
        Image::from_pixels(like.width(), like.height(), pixels)
            .ok_or_else(|| "the picture has no size".to_owned())
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        // SAFETY: the device is live, and used no more.
        unsafe { (self.api.release_device)(self.handle) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_there_is_no_library_the_error_says_how_to_get_it() {
        match Oidn::load() {
            Ok(_) => println!("skipped: this machine has Open Image Denoise"),
            Err(why) => assert!(why.contains("pip install pyoidn") && why.contains(FOLDER), "{why}"),
        }
    }
}
