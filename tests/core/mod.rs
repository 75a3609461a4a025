//! Tests of the core that take more than one part of it, or more than a moment. They are built with the library's own,
//! so that what is private can be tested too.

#![allow(clippy::unwrap_used)]

mod atlas;
pub mod beside;
mod capture;
mod cli_process;
mod cli_remedies;
pub mod common;
mod demo_scene;
mod fit_course;
mod hard_bench;
mod hard_cases;
pub mod hard_scenes;
mod image_files;
mod image_metrics;
mod insight_gallery;
mod insight_layers;
mod insight_record;
mod job_control;
mod job_preview;
mod light_environment;
mod light_sampler;
mod measured_cli;
mod measured_models;
mod measured_published;
mod measured_tables;
mod neural_energy;
mod neural_hard;
mod neural_model;
mod object_cli;
mod object_flow;
mod object_joint;
mod object_path_tracer;
mod object_scene;
mod object_study;
mod object_transport;
mod photo_cases;
mod photo_formats;
mod photo_fuzz;
mod photo_scenes;
pub mod program;
mod regions_read;
mod render_audit;
mod render_closed_scenes;
mod render_regions;
mod render_toys;
mod report;
mod scene_bad_input;
mod scene_doctor;
mod scene_fixture;
mod scene_meshes;
mod scene_read;
mod scene_real;
mod scene_together;
mod solver_run;
mod trace;
