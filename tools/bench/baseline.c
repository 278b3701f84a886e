/* What a careful C node would do with the topics of `robotd --robot cr3a` and with one service.
 *
 * A thread with absolute deadlines publishes joint states and the positions in every period and
 * the axis state at 100 Hz, a message object each, by rcl; the main thread answers
 * /baseline/trigger. SIGTERM ends it, with the statistics of its periods as JSON on standard
 * output:
 *
 *     baseline RATE_HZ REALTIME_PRIORITY
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <time.h>

#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/joint_state.h>
#include <std_msgs/msg/float64_multi_array.h>
#include <std_srvs/srv/trigger.h>

#define JOINTS 8
#define AXES 6
#define AXIS_STATE_HZ 100
#define SAMPLES 65536 /* periods whose figures are kept */
#define CHECK(call) check((call), #call)

/* wmx_ros2_message/msg/AxisState; its header file is not installed, its functions are. */
typedef struct {
  std_msgs__msg__Header header;
  rosidl_runtime_c__boolean__Sequence flags[7];
  rosidl_runtime_c__double__Sequence values[5];
} AxisState;

const rosidl_message_type_support_t *
rosidl_typesupport_c__get_message_type_support_handle__wmx_ros2_message__msg__AxisState(void);
bool wmx_ros2_message__msg__AxisState__init(AxisState *message);

static rcl_context_t context;
static rcl_node_t node;
static atomic_bool stopping;
static int priority; /* SCHED_FIFO of the publishing thread, where the system grants it */
static long period_ns, periods;
static long start_ns[SAMPLES], lateness_ns[SAMPLES], execution_ns[SAMPLES];

static void check(rcl_ret_t result, const char *call) {
  if (result == RCL_RET_OK) return;
  fprintf(stderr, "%s: %s\n", call, rcl_get_error_string().str);
  exit(1);
}

static long now_ns(clockid_t clock) {
  struct timespec time;
  clock_gettime(clock, &time);
  return time.tv_sec * 1000000000L + time.tv_nsec;
}

static void stamp(std_msgs__msg__Header *header) {
  long now = now_ns(CLOCK_REALTIME);
  header->stamp.sec = now / 1000000000L;
  header->stamp.nanosec = now % 1000000000L;
}

static rcl_publisher_t advertise(const rosidl_message_type_support_t *type, const char *topic) {
  rcl_publisher_t publisher = rcl_get_zero_initialized_publisher();
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  CHECK(rcl_publisher_init(&publisher, &node, type, topic, &options));
  return publisher;
}

static void *publish(void *unused) {
  static const char *names[JOINTS] = {"joint1", "joint2", "joint3", "joint4", "joint5", "joint6",
                                      "picker_1_joint", "picker_2_joint"};
  sensor_msgs__msg__JointState joints;
  std_msgs__msg__Float64MultiArray positions;
  AxisState axes;
  sensor_msgs__msg__JointState__init(&joints);
  std_msgs__msg__Float64MultiArray__init(&positions);
  wmx_ros2_message__msg__AxisState__init(&axes);
  rosidl_runtime_c__String__Sequence__init(&joints.name, JOINTS);
  for (int i = 0; i < JOINTS; i++) rosidl_runtime_c__String__assign(&joints.name.data[i], names[i]);
  rosidl_runtime_c__double__Sequence__init(&joints.position, JOINTS);
  rosidl_runtime_c__double__Sequence__init(&joints.velocity, JOINTS);
  rosidl_runtime_c__double__Sequence__init(&joints.effort, JOINTS);
  rosidl_runtime_c__double__Sequence__init(&positions.data, JOINTS);
  for (int i = 0; i < 7; i++) rosidl_runtime_c__boolean__Sequence__init(&axes.flags[i], AXES);
  for (int i = 0; i < 5; i++) rosidl_runtime_c__double__Sequence__init(&axes.values[i], AXES);
  rosidl_runtime_c__String__assign(&axes.header.frame_id, "base_link");
  rcl_publisher_t joint_states = advertise(
      ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "/joint_states");
  rcl_publisher_t commands = advertise(
      ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Float64MultiArray),
      "/gazebo_position_controller/commands");
  rcl_publisher_t axis_state = advertise(
      rosidl_typesupport_c__get_message_type_support_handle__wmx_ros2_message__msg__AxisState(),
      "/wmx/axis/state");

  prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
  if (priority) {
    struct sched_param parameters = {.sched_priority = priority};
    pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  }
  const long axis_every = 1000000000L / AXIS_STATE_HZ / period_ns;
  for (long deadline = now_ns(CLOCK_MONOTONIC) + period_ns; !stopping; deadline += period_ns) {
    struct timespec until = {deadline / 1000000000L, deadline % 1000000000L};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    long start = now_ns(CLOCK_MONOTONIC), late = start - deadline;
    deadline += late / period_ns * period_ns;
    for (int i = 0; i < JOINTS; i++) {
      joints.position.data[i] = positions.data.data[i] = (double)(periods + i);
      joints.velocity.data[i] = joints.effort.data[i] = (double)i;
    }
    stamp(&joints.header);
    CHECK(rcl_publish(&joint_states, &joints, NULL));
    CHECK(rcl_publish(&commands, &positions, NULL));
    if (periods % axis_every == 0) {
      for (int i = 0; i < AXES; i++) axes.values[2].data[i] = (double)(periods + i);
      stamp(&axes.header);
      CHECK(rcl_publish(&axis_state, &axes, NULL));
    }
    long slot = periods++ % SAMPLES;
    start_ns[slot] = start;
    lateness_ns[slot] = late;
    execution_ns[slot] = now_ns(CLOCK_MONOTONIC) - start;
  }
  return NULL;
}

static void serve(void) {
  rcl_service_t service = rcl_get_zero_initialized_service();
  rcl_service_options_t options = rcl_service_get_default_options();
  CHECK(rcl_service_init(&service, &node, ROSIDL_GET_SRV_TYPE_SUPPORT(std_srvs, srv, Trigger),
                         "/baseline/trigger", &options));
  rcl_wait_set_t wait_set = rcl_get_zero_initialized_wait_set();
  CHECK(rcl_wait_set_init(&wait_set, 0, 0, 0, 0, 1, 0, &context, rcl_get_default_allocator()));
  std_srvs__srv__Trigger_Request request;
  std_srvs__srv__Trigger_Response response;
  std_srvs__srv__Trigger_Request__init(&request);
  std_srvs__srv__Trigger_Response__init(&response);
  rosidl_runtime_c__String__assign(&response.message, "Communicating");
  response.success = true;
  while (!stopping) {
    CHECK(rcl_wait_set_clear(&wait_set));
    CHECK(rcl_wait_set_add_service(&wait_set, &service, NULL));
    if (rcl_wait(&wait_set, 100000000L) != RCL_RET_OK) continue;
    rmw_request_id_t id;
    if (rcl_take_request(&service, &id, &request) == RCL_RET_OK)
      CHECK(rcl_send_response(&service, &id, &response));
  }
}

static void stop(int number) { stopping = true; }

static void print_samples(const char *name, const long *values, long count, const char *end) {
  printf("\"%s\": [", name);
  for (long i = 0; i < count; i++) printf("%s%ld", i ? "," : "", values[i]);
  printf("]%s", end);
}

int main(int count, char **arguments) {
  if (count != 3) {
    fprintf(stderr, "usage: baseline RATE_HZ REALTIME_PRIORITY\n");
    return 2;
  }
  period_ns = 1000000000L / atol(arguments[1]);
  priority = atoi(arguments[2]);
  rcl_init_options_t init_options = rcl_get_zero_initialized_init_options();
  CHECK(rcl_init_options_init(&init_options, rcl_get_default_allocator()));
  context = rcl_get_zero_initialized_context();
  CHECK(rcl_init(0, NULL, &init_options, &context));
  node = rcl_get_zero_initialized_node();
  rcl_node_options_t node_options = rcl_node_get_default_options();
  CHECK(rcl_node_init(&node, "baseline", "", &context, &node_options));
  signal(SIGTERM, stop);
  signal(SIGINT, stop);

  pthread_t publisher;
  pthread_create(&publisher, NULL, publish, NULL);
  serve();
  pthread_join(publisher, NULL);

  long samples = periods < SAMPLES ? periods : SAMPLES;
  printf("{\"samples\": {");
  print_samples("start_ns", start_ns, samples, ", ");
  print_samples("lateness_ns", lateness_ns, samples, ", ");
  print_samples("execution_ns", execution_ns, samples, "}}\n");
  return 0;
}
