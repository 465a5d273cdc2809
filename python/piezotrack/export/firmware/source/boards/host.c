/*
 * A process on a computer: the link is a TCP port, the converters are those of a simulated stage
 * (piezotrack serve converters), which sends a code and a status for each sample and gets a code
 * back. It sets the pace: real time, or as fast as it is answered.
 *
 *     ./NAME-host PORT CONVERTERS_PORT [SETTINGS_FILE]
 */
#include "board.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "firmware.h"

/* Bytes of a sample from the converters, and of the answer. */
#define FRAME 5
#define ANSWER 4
/* How long an answer may take to leave before the client is hung up on, us. */
#define LEAVING_US 50000
/* How long a sample or a line is waited for, ms. */
#define PATIENCE 1

static const char *const *arguments;
static int count_of_arguments;
static int listener = -1;
static int client = -1;
static int converters = -1;
static bool held = true;
static bool answers; /* whether a sample waits for its answer */

static unsigned char frame[FRAME];
static int frame_bytes;
static unsigned char input[4096];
static int input_bytes;
static int input_place;
static char output[4096];
static int output_bytes;

static void give_up(const char *what)
{
    perror(what);
    exit(1);
}

static void without_delay(int link)
{
    const int yes = 1;
    (void)setsockopt(link, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
}

static struct sockaddr_in place_of(const char *port)
{
    struct sockaddr_in place = {0};
    const long number = strtol(port, NULL, 10);
    if (number < 0 || number > 65535) {
        fprintf(stderr, "port is %s: expected 0 to 65535\n", port);
        exit(2);
    }
    place.sin_family = AF_INET;
    place.sin_port = htons((uint16_t)number);
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return place;
}

/* Says how codes are meant. */
static void tell_converters(void)
{
    static const real scale[CONVERTERS_NUMBERS] = CONVERTERS_SCALE;
    const unsigned char bytes = REAL_BYTES;
    if (write(converters, &bytes, 1) != 1
        || write(converters, scale, sizeof scale) != (ssize_t)sizeof scale) {
        give_up("converters");
    }
}

void board_init(void)
{
    const int yes = 1;
    struct sockaddr_in place = place_of(arguments[1]);
    struct sockaddr_in stage = place_of(arguments[2]);
    socklen_t size = sizeof place;
    (void)signal(SIGPIPE, SIG_IGN);
    listener = socket(AF_INET, SOCK_STREAM, 0);
    converters = socket(AF_INET, SOCK_STREAM, 0);
    if (listener < 0 || converters < 0) {
        give_up("socket");
    }
    (void)setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(listener, (const struct sockaddr *)&place, sizeof place) != 0
        || listen(listener, 1) != 0
        || getsockname(listener, (struct sockaddr *)&place, &size) != 0) {
        give_up("listen");
    }
    if (connect(converters, (const struct sockaddr *)&stage, sizeof stage) != 0) {
        give_up("converters");
    }
    without_delay(converters);
    tell_converters();
    printf("firmware://127.0.0.1:%u\n", (unsigned)ntohs(place.sin_port));
    (void)fflush(stdout);
}

void board_write(uint32_t code)
{
    unsigned char answer[ANSWER];
    int i;
    if (!answers) {
        return; /* these converters take a code in answer to a sample alone */
    }
    for (i = 0; i < ANSWER; i++) {
        answer[i] = (unsigned char)((code >> (8 * i)) & 255u);
    }
    if (write(converters, answer, ANSWER) != ANSWER) {
        give_up("converters");
    }
}

uint32_t board_millis(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000u + (uint32_t)(now.tv_nsec / 1000000);
}

static void hang_up(void)
{
    (void)close(client);
    client = -1;
    input_bytes = 0;
    input_place = 0;
    output_bytes = 0;
}

static void flush_output(void)
{
    int sent = 0;
    while (client >= 0 && sent < output_bytes) {
        const ssize_t now = write(client, &output[sent], (size_t)(output_bytes - sent));
        if (now <= 0) {
            hang_up();
        } else {
            sent += (int)now;
        }
    }
    output_bytes = 0;
}

/* Tells a second client that it is one. */
static void turn_away(void)
{
    static const char busy[] = "error another program has the link\n";
    const int other = accept(listener, NULL, NULL);
    if (other >= 0) {
        if (write(other, busy, sizeof busy - 1u) < 0) {
            perror("second client");
        }
        (void)close(other);
    }
}

/* Takes what the converters have sent; calls firmware_sample for a whole frame. */
static void take_sample(void)
{
    const ssize_t now = read(converters, &frame[frame_bytes], (size_t)(FRAME - frame_bytes));
    if (now <= 0) {
        fprintf(stderr, "the converters are gone\n");
        exit(1);
    }
    frame_bytes += (int)now;
    if (frame_bytes == FRAME) {
        const uint32_t code = (uint32_t)frame[0] | ((uint32_t)frame[1] << 8)
            | ((uint32_t)frame[2] << 16) | ((uint32_t)frame[3] << 24);
        frame_bytes = 0;
        answers = true;
        firmware_sample(code, frame[4]);
        answers = false;
    }
}

int board_get(void)
{
    bool had_client;
    struct pollfd watched[3] = {{0, POLLIN, 0}, {0, POLLIN, 0}, {0, POLLIN, 0}};
    if (input_place < input_bytes) {
        return input[input_place++];
    }
    had_client = client >= 0;
    flush_output();
    if (had_client && (client < 0)) {
        return -1; /* before another one is taken */
    }
    watched[0].fd = held ? -1 : converters;
    watched[1].fd = client >= 0 ? client : listener;
    watched[2].fd = client >= 0 ? listener : -1;
    if (poll(watched, 3, PATIENCE) <= 0) {
        return -1;
    }
    if (watched[0].revents != 0) {
        take_sample();
    }
    if (watched[1].revents == 0) {
        if (watched[2].revents != 0) {
            turn_away();
        }
        return -1;
    }
    if (client < 0) {
        client = accept(listener, NULL, NULL);
        if (client >= 0) {
            const struct timeval leaving = {0, LEAVING_US};
            without_delay(client);
            (void)setsockopt(client, SOL_SOCKET, SO_SNDTIMEO, &leaving, sizeof leaving);
        }
        return -1;
    }
    input_place = 0;
    input_bytes = (int)read(client, input, sizeof input);
    if (input_bytes <= 0) {
        hang_up();
        return -1;
    }
    return input[input_place++];
}

void board_put(char byte)
{
    if (output_bytes == (int)sizeof output) {
        flush_output();
    }
    output[output_bytes] = byte;
    output_bytes++;
}

bool board_linked(void)
{
    return client >= 0;
}

void board_feed(void)
{
    flush_output();
}

void board_mask(bool now)
{
    held = now; /* between samples, which come within board_get alone */
}

bool board_store(const void *image, uint32_t bytes)
{
    FILE *file;
    bool done;
    if (count_of_arguments < 4) {
        return false;
    }
    file = fopen(arguments[3], "wb");
    done = file != NULL && fwrite(image, bytes, 1, file) == 1;
    return file != NULL && fclose(file) == 0 && done;
}

bool board_recall(void *image, uint32_t bytes)
{
    FILE *file = count_of_arguments < 4 ? NULL : fopen(arguments[3], "rb");
    bool done;
    if (file == NULL) {
        return false;
    }
    done = fread(image, bytes, 1, file) == 1;
    (void)fclose(file);
    return done;
}

int main(int count, char **given)
{
    if (count < 3) {
        fprintf(stderr, "expected PORT CONVERTERS_PORT [SETTINGS_FILE]\n");
        return 2;
    }
    arguments = (const char *const *)given;
    count_of_arguments = count;
    board_init();
    firmware_init();
    board_mask(false);
    for (;;) {
        firmware_poll();
    }
}
