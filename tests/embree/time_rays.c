/* Times single rays of Embree 3 on a mesh and rays that `patina bench tracer --embree` wrote.
 *
 *     cc -O3 -march=native tests/embree/time_rays.c -lembree3 -lpthread -o time_rays
 *     time_rays FILE THREADS REPETITIONS
 *
 * One line a repetition and a way of building: a JSON object with the name of the way, millions of camera, bounce and
 * shadow rays a second, and how many of each met something. Rays are asked for one by one (`rtcIntersect1`,
 * `rtcOccluded1`), from as many threads as are asked for; the tree is built before the clock starts, with the highest
 * quality Embree has.
 *
 * The file, little endian: five u32 (points, triangles, camera rays, bounce rays, shadow rays), points as three f32,
 * triangles as three u32, rays as seven f32 (origin, direction, end).
 */
#define _GNU_SOURCE
#include <embree3/rtcore.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { CHUNK = 1024, KINDS = 3, THREADS_MAX = 256 };

struct ray { float origin[3], direction[3], end; };
struct rays { struct ray *list; unsigned count; };
struct work { RTCScene scene; struct rays rays; int any; atomic_uint next, met; };

static void *read_items(FILE *file, size_t count, size_t size) {
    void *items = malloc(count * size + 16);
    if (items == NULL || fread(items, size, count, file) != count) {
        fprintf(stderr, "the file of rays ends too early\n");
        exit(1);
    }
    return items;
}

static struct RTCRay embree_ray(const struct ray *ray) {
    struct RTCRay made;
    made.org_x = ray->origin[0], made.org_y = ray->origin[1], made.org_z = ray->origin[2];
    made.dir_x = ray->direction[0], made.dir_y = ray->direction[1], made.dir_z = ray->direction[2];
    made.tnear = 0, made.tfar = ray->end, made.time = 0;
    made.mask = 0xffffffff, made.id = 0, made.flags = 0;
    return made;
}

static void *trace(void *shared) {
    struct work *work = shared;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    unsigned met = 0, start;
    while ((start = atomic_fetch_add(&work->next, CHUNK)) < work->rays.count) {
        unsigned end = start + CHUNK < work->rays.count ? start + CHUNK : work->rays.count;
        for (unsigned index = start; index < end; index++) {
            if (work->any) {
                struct RTCRay ray = embree_ray(&work->rays.list[index]);
                rtcOccluded1(work->scene, &context, &ray);
                met += ray.tfar < 0;
            } else {
                struct RTCRayHit hit;
                hit.ray = embree_ray(&work->rays.list[index]);
                hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                rtcIntersect1(work->scene, &context, &hit);
                met += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
            }
        }
    }
    atomic_fetch_add(&work->met, met);
    return NULL;
}

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

/* Millions of rays a second, and how many met something. */
static double rate(RTCScene scene, struct rays rays, int any, int threads, unsigned *met) {
    struct work work = {.scene = scene, .rays = rays, .any = any};
    pthread_t started[THREADS_MAX];
    double began = now();
    for (int thread = 1; thread < threads; thread++) {
        pthread_create(&started[thread], NULL, trace, &work);
    }
    trace(&work);
    for (int thread = 1; thread < threads; thread++) {
        pthread_join(started[thread], NULL);
    }
    *met = work.met;
    return rays.count / (now() - began) / 1e6;
}

static RTCScene build(RTCDevice device, float *points, unsigned *triangles, const unsigned *counts, enum RTCSceneFlags flags) {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(scene, flags);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, points, 0, 12, counts[0]);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles, 0, 12, counts[1]);
    rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene);
    return scene;
}

int main(int count, char **arguments) {
    if (count != 4) {
        fprintf(stderr, "time_rays FILE THREADS REPETITIONS\n");
        return 2;
    }
    int threads = atoi(arguments[2]), repetitions = atoi(arguments[3]);
    FILE *file = fopen(arguments[1], "rb");
    if (file == NULL || threads < 1 || threads > THREADS_MAX) {
        fprintf(stderr, file == NULL ? "there is no such file of rays\n" : "from 1 to 256 threads\n");
        return 1;
    }
    unsigned *counts = read_items(file, 2 + KINDS, sizeof(unsigned));
    float *points = read_items(file, 3 * (size_t)counts[0], sizeof(float));
    unsigned *triangles = read_items(file, 3 * (size_t)counts[1], sizeof(unsigned));
    struct rays rays[KINDS];
    for (int kind = 0; kind < KINDS; kind++) {
        rays[kind].count = counts[2 + kind];
        rays[kind].list = read_items(file, rays[kind].count, sizeof(struct ray));
    }
    fclose(file);
    RTCDevice device = rtcNewDevice(NULL);
    const char *names[] = {"embree", "embree, robust"};
    RTCScene scenes[] = {build(device, points, triangles, counts, RTC_SCENE_FLAG_NONE),
                         build(device, points, triangles, counts, RTC_SCENE_FLAG_ROBUST)};
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) {
        fprintf(stderr, "Embree could not build the scene\n");
        return 1;
    }
    for (int repetition = 0; repetition <= repetitions; repetition++) {
        for (int way = 0; way < 2; way++) {
            double rates[KINDS];
            unsigned met[KINDS];
            for (int kind = 0; kind < KINDS; kind++) {
                rates[kind] = rate(scenes[way], rays[kind], kind == 2, threads, &met[kind]);
            }
            /* The first touches memory for the first time. */
            if (repetition > 0) {
                printf("{\"name\": \"%s\", \"rates\": [%f, %f, %f], \"met\": [%u, %u, %u]}\n", names[way], rates[0], rates[1],
                       rates[2], met[0], met[1], met[2]);
            }
        }
    }
    return 0;
}
