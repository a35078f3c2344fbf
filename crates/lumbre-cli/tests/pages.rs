//! Pages at rest: `lumbre view --export`.

#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::fs;

use crate::parts::{bytes, done, folder, refused};

#[test]
fn a_page_replaces_an_earlier_one_and_nothing_else() {
    let folder = folder();
    let export = "view scene.pbrt --size 12x9 --spp 1 --export page";
    let names = ["data.js", "icon.svg", "index.html", "viewer.css", "viewer.js"];
    for name in names {
        fs::create_dir(folder.path("page")).unwrap();
        folder.write(&format!("page/{name}"), "mine");
        refused(&folder, export, 2, &format!("page/{name}: it is no file of an earlier page"));
        assert_eq!(bytes(&folder, &format!("page/{name}")), b"mine");
        assert_eq!(fs::read_dir(folder.path("page")).unwrap().count(), 1);
        fs::remove_dir_all(folder.path("page")).unwrap();
    }
    done(&folder, export);
    let first = bytes(&folder, "page/data.js");
    folder.write("page/notes.txt", "mine");
    done(&folder, &export.replace("--spp 1", "--spp 2"));
    assert_ne!(bytes(&folder, "page/data.js"), first);
    assert_eq!(bytes(&folder, "page/notes.txt"), b"mine");
    assert!(names.iter().all(|name| folder.path(&format!("page/{name}")).is_file()));
    #[cfg(unix)]
    {
        // Neither a link to what is not there, nor a pipe.
        fs::remove_file(folder.path("page/icon.svg")).unwrap();
        std::os::unix::fs::symlink("../elsewhere", folder.path("page/icon.svg")).unwrap();
        refused(&folder, export, 2, "page/icon.svg: it is no file of an earlier page");
        assert!(!folder.path("elsewhere").exists());
        fs::remove_file(folder.path("page/icon.svg")).unwrap();
        assert!(
            std::process::Command::new("mkfifo")
                .arg(folder.path("page/icon.svg"))
                .status()
                .unwrap()
                .success()
        );
        refused(&folder, export, 2, "page/icon.svg: it is no file of an earlier page");
    }
}

#[test]
fn a_picture_that_does_not_fit_is_refused_by_all_who_render() {
    let folder = folder();
    for command in ["render scene.pbrt -o a.png", "view scene.pbrt --export page"] {
        refused(
            &folder,
            &format!("{command} --size 30000x30000 --max-memory 1G"),
            5,
            "a picture of 30000 by 30000 pixels: needs",
        );
    }
    // As the file says it, too.
    let scene = fs::read_to_string(folder.path("scene.pbrt")).unwrap();
    let large = scene
        .replace("xresolution\" 33", "xresolution\" 30000")
        .replace("yresolution\" 21", "yresolution\" 30000");
    assert_ne!(large, scene);
    folder.write("large.pbrt", &large);
    for command in ["render large.pbrt -o a.png", "view large.pbrt --export page"] {
        refused(
            &folder,
            &format!("{command} --max-memory 1G"),
            5,
            "a picture of 30000 by 30000 pixels: needs",
        );
    }
    assert!(!folder.path("page").exists() && !folder.path("a.png").exists());
}
