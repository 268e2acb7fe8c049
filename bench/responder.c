/* The other end of the wire for the measurements: servos that answer at once.

   A library can only be timed against something that is never slower than itself, and that notices when a library
   cheats. So this answers FEETECH PING, READ, WRITE, SYNC READ and SYNC WRITE from plain memory, a whole sync-read
   train in one write(), and keeps books: the present position of a servo counts how often it was read, so a stale,
   skipped or doubled reading shows in the values, and every goal that arrives is added up. It counts up to the end of
   its range and down again, to and fro, for no motor jumps from one end to the other.

   With a baud rate as its argument bytes take their time, ten bits each, as on a half-duplex line: what arrives waits
   until the line is free, and an answer is there when its last byte has passed. A second argument is the turnaround in
   microseconds: so long the line is silent between a request and its answers, which then come without a gap. A third
   says which ids are there, a fourth how an answer of several packets is handed over: 0 all of it at once, when its
   last byte has passed, as by an adapter that holds bytes back for longer than it takes; 1 each packet as its own last
   byte has passed, as by one that does not.

   Prints the path of its pseudo-terminal as one line. When standard input ends it prints its books and ends. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { SERVOS = 253, BROADCAST = 254, GOAL = 42, POSITION = 56, COUNTS = 4096, ROOM = 65536 };
enum { THERE_AND_BACK = 2 * (COUNTS - 1) };
enum { BITS = 10, SECOND = 1000000000, EXACTLY = 60000, WATCHFUL = 300000 };
enum { PING = 1, READ = 2, WRITE = 3, SYNC_READ = 0x82, SYNC_WRITE = 0x83 };

typedef unsigned char byte;

struct servo {
    byte memory[256];
    unsigned long reads, writes, goals;
};

static struct servo servos[SERVOS + 1];
static unsigned long frames, strays;
/* Only ids that this divides are there. */
static int every = 1;
/* Each packet is handed over as it has passed. */
static int pieces;
/* Nanoseconds that a byte takes, 0 where it takes none; when the line is free again; when an answer left last. */
static long long byte_time, line_free, answered, turnaround;
static byte answer[ROOM];
static size_t filled;
static int urgent;

/* Position of servo n before its first reading; the contenders know the same rule. */
static unsigned position_of(int id) {
    unsigned long at = (100u * (unsigned)id + servos[id].reads) % THERE_AND_BACK;
    return (unsigned)(at < COUNTS ? at : THERE_AND_BACK - at);
}

static struct servo *servo_of(int id) {
    return id >= 1 && id <= SERVOS && id % every == 0 ? &servos[id] : NULL;
}

static byte checksum(const byte *from, size_t count) {
    unsigned sum = 0;
    while (count--) sum += *from++;
    return (byte)~sum;
}

static void reply(int id, const byte *data, size_t count) {
    byte *frame = answer + filled;
    if (filled + count + 6 > ROOM) return;
    frame[0] = frame[1] = 0xFF;
    frame[2] = (byte)id;
    frame[3] = (byte)(count + 2);
    frame[4] = 0;
    memcpy(frame + 5, data, count);
    frame[5 + count] = checksum(frame + 2, count + 3);
    filled += count + 6;
}

static void read_memory(int id, unsigned address, unsigned count) {
    struct servo *servo = servo_of(id);
    if (!servo || address + count > sizeof servo->memory) return;
    if (address <= POSITION && address + count >= POSITION + 2) {
        unsigned position = position_of(id);
        servo->memory[POSITION] = (byte)position;
        servo->memory[POSITION + 1] = (byte)(position >> 8);
        servo->reads++;
    }
    reply(id, servo->memory + address, count);
}

static int write_memory(int id, unsigned address, const byte *data, unsigned count) {
    struct servo *servo = servo_of(id);
    if (!servo || address + count > sizeof servo->memory) return 0;
    memcpy(servo->memory + address, data, count);
    if (address <= GOAL && address + count >= GOAL + 2) {
        servo->writes++;
        servo->goals += servo->memory[GOAL] | servo->memory[GOAL + 1] << 8;
    }
    return 1;
}

static void carry_out(int id, int instruction, const byte *parameters, unsigned count) {
    if (instruction == PING && servo_of(id)) {
        reply(id, parameters, 0);
    } else if (instruction == READ && count == 2) {
        read_memory(id, parameters[0], parameters[1]);
    } else if (instruction == WRITE && count > 1) {
        if (write_memory(id, parameters[0], parameters + 1, count - 1)) reply(id, parameters, 0);
    } else if (instruction == SYNC_READ && count > 2) {
        for (unsigned i = 2; i < count; i++) read_memory(parameters[i], parameters[0], parameters[1]);
    } else if (instruction == SYNC_WRITE && count > 2) {
        unsigned each = parameters[1];
        for (unsigned i = 2; i + 1 + each <= count; i += 1 + each)
            write_memory(parameters[i], parameters[0], parameters + i + 1, each);
    } else {
        strays++;
    }
}

/* Carries out every whole packet in the buffer; returns how many bytes are done with. */
static size_t take(const byte *from, size_t have) {
    size_t at = 0;
    while (have - at >= 6) {
        const byte *frame = from + at;
        size_t length = frame[3];
        if (frame[0] != 0xFF || frame[1] != 0xFF || frame[2] > BROADCAST || length < 2) {
            strays++, at++;
            continue;
        }
        if (have - at < length + 4) break;
        if (checksum(frame + 2, length + 1) != frame[length + 3]) {
            strays++, at++;
            continue;
        }
        frames++;
        carry_out(frame[2], frame[4], frame + 5, (unsigned)length - 2);
        at += length + 4;
    }
    return at;
}

static int open_terminal(void) {
    struct termios raw;
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) || unlockpt(master)) exit(1);
    /* One open slave of our own: the line stays raw, and the master does not hang up when a contender leaves. */
    int slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    if (slave < 0 || tcgetattr(slave, &raw)) exit(1);
    cfmakeraw(&raw);
    cfsetspeed(&raw, B1000000);
    if (tcsetattr(slave, TCSANOW, &raw)) exit(1);
    return master;
}

static long long now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (long long)time.tv_sec * SECOND + time.tv_nsec;
}

/* These bytes pass: from now on, or from when the line is free. */
static void pass(size_t count) {
    long long begin = now();
    line_free = (line_free > begin ? line_free : begin) + (long long)count * byte_time;
}

/* A system wakes nobody to the microsecond, so the last of the time is spent looking at the clock. */
static void wait_for_line(void) {
    long long until = line_free - EXACTLY;
    struct timespec moment = {until / SECOND, until % SECOND};
    if (until > now()) while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &moment, NULL) == EINTR) continue;
    while (now() < line_free) continue;
}

static void send_bytes(int master, const byte *from, size_t count) {
    for (size_t sent = 0; sent < count;) {
        ssize_t gone = write(master, from + sent, count - sent);
        if (gone <= 0) exit(1);
        sent += (size_t)gone;
    }
}

/* On a line that takes its time: all of it when its last byte has passed, or each packet as its own has. */
static void send_answer(int master) {
    line_free += turnaround;
    if (byte_time) pass(0);
    for (size_t sent = 0; sent < filled;) {
        size_t next = pieces ? (size_t)answer[sent + 3] + 4 : filled;
        if (byte_time) {
            /* Not from now on: a piece that was handed over late does not hold up what passes after it. */
            line_free += (long long)next * byte_time;
            wait_for_line();
            answered = now();
        }
        send_bytes(master, answer + sent, next);
        sent += next;
    }
    filled = 0;
}

static void print_books(void) {
    printf("{\"frames\": %lu, \"strays\": %lu, \"servos\": {", frames, strays);
    for (int id = 1; id <= SERVOS; id++)
        printf("%s\"%d\": [%lu, %lu, %lu]", id > 1 ? ", " : "", id, servos[id].reads, servos[id].writes,
               servos[id].goals);
    puts("}}");
}

/* Bytes may be there, or our input has ended. For a while after an answer the next request is near: then it looks
   without sleeping, for a line would not have slept either. Not so with real-time priority: bytes get from one end of
   a terminal to the other by a worker of the system, which has none, and would wait until this sleeps. */
static int something(struct pollfd *watched) {
    int found = 0;
    while (byte_time && !urgent && !found && now() - answered < WATCHFUL) found = poll(watched, 2, 0);
    return found ? found : poll(watched, 2, -1);
}

int main(int count_of_arguments, char **arguments) {
    static byte buffer[ROOM];
    size_t have = 0;
    long baud = count_of_arguments > 1 ? atol(arguments[1]) : 0;
    byte_time = baud > 0 ? (long long)BITS * SECOND / baud : 0;
    turnaround = count_of_arguments > 2 ? atol(arguments[2]) * 1000 : 0;
    every = count_of_arguments > 3 ? atoi(arguments[3]) : 1;
    pieces = count_of_arguments > 4 ? atoi(arguments[4]) : 0;
    prctl(PR_SET_TIMERSLACK, 1);
    urgent = sched_getscheduler(0) == SCHED_FIFO;
    int master = open_terminal();
    struct pollfd watched[] = {{.fd = master, .events = POLLIN}, {.fd = STDIN_FILENO, .events = POLLIN}};
    for (int id = 1; id <= SERVOS; id++) {
        /* Firmware 3.10, low byte first, STS3215; id, rate, delay, answers everything, limits 0 to 4095; its phase makes
           velocities counts/s. */
        byte start[] = {3, 10, 0, 9, 3, (byte)id, 0, 0, 1, 0, 0, 0xFF, 0x0F, 0, 0, 0, 0, 0, 12};
        /* Velocity, load, 12.0 V, temperature, no asynchronous write, no alarm, it moves, 2 unused, current; the
           contenders know the same rule. */
        byte shown[] = {(byte)(50 + id), (byte)((50 + id) >> 8), (byte)(100 + id), (byte)((100 + id) >> 8), 120,
                        (byte)(30 + id % 8), 0, 0, 1, 0, 0, (byte)(10 + id), (byte)((10 + id) >> 8)};
        memcpy(servos[id].memory, start, sizeof start);
        memcpy(servos[id].memory + POSITION + 2, shown, sizeof shown);
    }
    puts(ptsname(master));
    fflush(stdout);
    while (something(watched) > 0) {
        if (watched[0].revents & POLLIN) {
            ssize_t count = read(master, buffer + have, sizeof buffer - have);
            if (count <= 0) return 1;
            if (byte_time) pass((size_t)count);
            have += (size_t)count;
            size_t done = take(buffer, have);
            memmove(buffer, buffer + done, have -= done);
            if (filled) send_answer(master);
        } else if (watched[1].revents) {
            break;
        }
    }
    print_books();
    return 0;
}
